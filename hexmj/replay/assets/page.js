"use strict";

const SPEEDS = [1, 1 / 2, 1 / 4, 1 / 10, 1 / 30];
const VIEWS = { corner: [-2.2, 0.42], side: [-Math.PI / 2, 0.1], above: [-Math.PI / 2, 1.5], ahead: [0, 0.22] };
const SUN = [0.28, -0.22, 0.93];
const KINDS = { f4: Float32Array, f8: Float64Array, i4: Int32Array, u4: Uint32Array, u1: Uint8Array };

/* ---- what was recorded ---- */

function unpacked(value) {
  if (value === null || typeof value !== "object" || Array.isArray(value)) return value;
  if (!("bytes" in value)) return Object.fromEntries(Object.entries(value).map(([key, one]) => [key, unpacked(one)]));
  const bytes = Uint8Array.from(atob(value.bytes), (one) => one.charCodeAt(0));
  return Object.assign(new KINDS[value.type](bytes.buffer), { shape: value.shape });
}

function item(array, ...at) {
  const sizes = array.shape.slice(at.length);
  const size = sizes.reduce((a, b) => a * b, 1);
  const first = at.reduce((sum, one, i) => sum * array.shape[i] + one, 0) * size;
  return array.subarray(first, first + size);
}

class Recording {
  constructor(packed) {
    Object.assign(this, unpacked(packed));
    this.margin = this.physical ? this.grounded_margin : this.planned_margin;
    this.stance = this.physical ? this.grounded_stance : this.planned_stance;
    this.begin = this.seconds[0] - this.step;
    this.end = this.seconds[this.seconds.length - 1];
  }

  /** Return the step whose end is nearest to a time. */
  row(seconds) {
    const row = Math.round((seconds - this.seconds[0]) / this.step);
    return Math.min(Math.max(row, 0), this.seconds.length - 1);
  }

  /** Return the pose nearest to a step, after a fall the last one. */
  pose(row) {
    let low = 0, high = this.rows.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.rows[middle] < row) low = middle + 1; else high = middle;
    }
    return low > 0 && row - this.rows[low - 1] < this.rows[low] - row ? low - 1 : low;
  }

  fallen(seconds) { return this.fell !== null && seconds >= this.fell; }
}

/* ---- vectors and matrices, column by column ---- */

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => a.map((one) => one / Math.hypot(...a));

function product(a, b) {
  const c = new Float32Array(16);
  for (let i = 0; i < 4; i++) for (let j = 0; j < 4; j++)
    for (let k = 0; k < 4; k++) c[4 * i + j] += a[4 * k + j] * b[4 * i + k];
  return c;
}

function looking(eye, target) {
  const back = unit(eye.map((one, i) => one - target[i]));
  const right = unit(cross([0, 0, 1], back));
  const up = cross(back, right);
  const rows = [right, up, back];
  return [0, 1, 2].flatMap((i) => [right[i], up[i], back[i], 0]).concat(rows.map((one) => -dot(one, eye)), 1);
}

function perspective(aspect, near, far) {
  const f = aspect < 1 ? 2.6 * aspect ** 0.4 : 2.6;
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, 2 * far * near / (near - far), 0];
}

/* ---- the scene ---- */

const SHADERS = {
  solid: [`in vec3 corner, normal, colour; in float body; uniform mat4 camera; uniform vec4 poses[POSES];
    uniform vec4 shadow; out vec3 n, c;
    vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.yzw, cross(q.yzw, v) + q.x * v); }
    void main() {
      int i = 2 * int(body);
      vec3 p = poses[i].xyz + turned(poses[i + 1], corner);
      n = turned(poses[i + 1], normal); c = colour;
      if (shadow.w > 0.0) p = vec3(p.xy - SUN.xy / SUN.z * (p.z - shadow.z), shadow.z);
      gl_Position = camera * vec4(p, 1.0);
    }`, `in vec3 n, c; uniform vec4 shadow; out vec4 seen;
    void main() {
      vec3 m = normalize(n);
      float light = 0.55 + 0.2 * m.z + 0.75 * max(dot(m, SUN), 0.0);
      seen = shadow.w > 0.0 ? vec4(0.0, 0.0, 0.0, shadow.w) : vec4(pow(c, vec3(0.8)) * light + 0.06, 1.0);
    }`],
  ground: [`in vec3 corner, normal; uniform mat4 camera; uniform vec3 middle; out vec3 p, n;
    void main() { p = corner + middle; n = normal; gl_Position = camera * vec4(p, 1.0); }`,
    `in vec3 p, n; uniform vec3 floor_, grid, sky, target; uniform float reach, square; out vec4 seen;
    void main() {
      vec2 at = p.xy / square, width = fwidth(at);
      vec2 far = abs(fract(at - 0.5) - 0.5) / max(width, 1e-4);
      float line = (1.0 - min(min(far.x, far.y), 1.0)) * (1.0 - smoothstep(0.15, 0.5, max(width.x, width.y)));
      float light = 0.5 + 0.5 * dot(normalize(n), SUN) / SUN.z;
      float height = clamp(p.z / square, 0.0, 0.8);
      vec3 colour = mix(mix(floor_, grid, 0.6 * height), grid, line * step(0.5, n.z)) * mix(1.0, light, 0.8);
      seen = vec4(mix(colour, sky, smoothstep(0.35, 1.0, length(p.xy - target.xy) / reach)), 1.0);
    }`],
  flat_: [`in vec3 corner; uniform mat4 camera; out vec3 p;
    void main() { p = corner; gl_Position = camera * vec4(p, 1.0); }`,
    `in vec3 p; uniform vec4 colour; uniform float stripes; out vec4 seen;
    void main() {
      float band = stripes > 0.0 ? step(0.5, fract((p.x + p.y) / stripes)) : 1.0;
      seen = vec4(colour.rgb, colour.a * mix(0.25, 1.0, band));
    }`],
};

class Scene {
  constructor(canvas, recording, reach) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: true, stencil: true });
    if (!gl) throw new Error("no WebGL 2");
    Object.assign(this, { canvas, gl, recording, reach, programs: {} });
    const constants = { POSES: 2 * recording.poses.shape[1], SUN: `vec3(${SUN.join(", ")})` };
    for (const [name, parts] of Object.entries(SHADERS)) this.programs[name] = this.compiled(parts, constants);
    this.body = this.loaded(this.programs.solid, recording.body);
    this.laid = this.loaded(this.programs.ground, recording.ground);
    const far = [[-1, -1], [1, -1], [1, 1], [-1, 1]].flatMap(([x, y]) => [reach * x, reach * y, 0]);
    const plane = { corners: far, normals: [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1], faces: [0, 1, 2, 0, 2, 3] };
    this.plane = this.loaded(this.programs.ground, plane);
    this.flat = gl.createBuffer();
  }

  compiled(parts, constants) {
    const gl = this.gl, program = gl.createProgram();
    parts.forEach((part, i) => {
      let source = part;
      for (const [name, value] of Object.entries(constants)) source = source.replaceAll(new RegExp(`\\b${name}\\b`, "g"), value);
      const shader = gl.createShader(i ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
      gl.shaderSource(shader, `#version 300 es\nprecision highp float; precision highp int;\n${source}`);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    });
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const places = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const name = gl.getActiveUniform(program, i).name.replace("[0]", "");
      places[name] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  loaded({ program }, shape) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const columns = { corner: shape.corners, normal: shape.normals, colour: shape.colour, body: shape.body };
    for (const [name, values] of Object.entries(columns)) {
      const place = gl.getAttribLocation(program, name);
      if (place < 0 || !values) continue;
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, name === "body" ? 1 : 3, gl.FLOAT, false, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(shape.faces), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { array, count: shape.faces.length };
  }

  draw(pose, stable, eye, target, size, theme) {
    const { gl, canvas, recording } = this;
    const scale = Math.min(window.devicePixelRatio || 1, 2);
    fit(canvas, scale);
    gl.viewport(0, 0, canvas.width, canvas.height);
    const aspect = canvas.width / canvas.height;
    this.camera = product(perspective(aspect, size / 50, 100 * size), looking(eye, target));
    gl.clearColor(...theme.sky, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    const ground = { floor_: theme.floor, grid: theme.grid, sky: theme.sky, target, reach: this.reach, square: 10 };
    gl.enable(gl.POLYGON_OFFSET_FILL);
    gl.polygonOffset(1, 8);
    this.use("ground", { ...ground, middle: [target[0], target[1], recording.plane] });
    this.triangles(this.plane);
    this.use("ground", { ...ground, middle: [0, 0, 0] });
    this.triangles(this.laid);
    gl.disable(gl.POLYGON_OFFSET_FILL);

    const level = recording.level[pose];
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    if (!recording.gap) {
      gl.enable(gl.STENCIL_TEST);
      gl.stencilFunc(gl.EQUAL, 0, 255);
      gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
      this.bodies(pose, [0, 0, 0.02, 0.22]);
      gl.disable(gl.STENCIL_TEST);
    }
    this.polygon(pose, stable, level, theme);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    this.bodies(pose, [0, 0, 0, 0]);
  }

  bodies(pose, shadow) {
    const poses = item(this.recording.poses, pose);
    const filled = new Float32Array(poses.length / 7 * 8);
    for (let i = 0; i < poses.length / 7; i++) {
      filled.set(poses.subarray(7 * i, 7 * i + 3), 8 * i);
      filled.set(poses.subarray(7 * i + 3, 7 * i + 7), 8 * i + 4);
    }
    this.use("solid", { shadow, poses: filled });
    this.triangles(this.body);
  }

  polygon(pose, stable, level, theme) {
    const { recording } = this, flat = item(recording.polygon, pose), z = level + 0.06;
    const corners = [];
    for (let i = 0; i < 6 && !Number.isNaN(flat[2 * i]); i++) corners.push([flat[2 * i], flat[2 * i + 1]]);
    const colour = stable ? theme.stable : theme.lost, width = recording.marks.outline;
    const fan = [], edges = [];
    for (let i = 1; i + 1 < corners.length; i++)
      for (const one of [corners[0], corners[i], corners[i + 1]]) fan.push(one[0], one[1], z);
    if (corners.length > 1) corners.forEach((a, i) => {
      const b = corners[(i + 1) % corners.length], length = Math.hypot(b[0] - a[0], b[1] - a[1]);
      if (!length) return;
      const x = -(b[1] - a[1]) / length * width, y = (b[0] - a[0]) / length * width;
      for (const [one, side] of [[a, 1], [b, 1], [b, -1], [a, 1], [b, -1], [a, -1]])
        edges.push(one[0] + side * x, one[1] + side * y, z + 0.04);
    });
    this.sheet(fan, [...colour, stable ? 0.32 : 0.5], stable ? 0 : 7);
    this.sheet(edges, [...colour, 1], 0);
    const [x, y] = item(recording.centre_of_mass, pose), radius = recording.marks.centre;
    const quarter = (first) => {
      const disc = [];
      for (let i = 0; i < 24; i++) if (Math.floor(i / 6) % 2 === first)
        for (const [at, r] of [[0, 0], [i, radius], [i + 1, radius]])
          disc.push(x + r * Math.cos(at * Math.PI / 12), y + r * Math.sin(at * Math.PI / 12), z + 0.1);
      return disc;
    };
    this.sheet(quarter(0), [...theme.centre, 1], 0);
    this.sheet(quarter(1), [0.08, 0.08, 0.08, 1], 0);
  }

  sheet(corners, colour, stripes) {
    const gl = this.gl, { program } = this.programs.flat_;
    if (!corners.length) return;
    this.use("flat_", { colour, stripes });
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.flat);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners), gl.DYNAMIC_DRAW);
    const place = gl.getAttribLocation(program, "corner");
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    gl.drawArrays(gl.TRIANGLES, 0, corners.length / 3);
  }

  use(name, values) {
    const gl = this.gl, { program, places } = this.programs[name];
    gl.useProgram(program);
    gl.uniformMatrix4fv(places.camera, false, this.camera);
    for (const [key, value] of Object.entries(values)) {
      const place = places[key];
      if (!place) continue;
      if (key === "poses") gl.uniform4fv(place, value);
      else if (typeof value === "number") gl.uniform1f(place, value);
      else if (value.length === 3) gl.uniform3fv(place, value);
      else gl.uniform4fv(place, value);
    }
  }

  triangles({ array, count }) {
    this.gl.bindVertexArray(array);
    this.gl.drawElements(this.gl.TRIANGLES, count, this.gl.UNSIGNED_INT, 0);
  }

  /** Return the place of a point of the world on the canvas, from its upper left corner [CSS pixels]. */
  seen([x, y, z]) {
    const m = this.camera, w = m[3] * x + m[7] * y + m[11] * z + m[15];
    const across = (m[0] * x + m[4] * y + m[8] * z + m[12]) / w, up = (m[1] * x + m[5] * y + m[9] * z + m[13]) / w;
    return [(1 + across) / 2 * this.canvas.clientWidth, (1 - up) / 2 * this.canvas.clientHeight];
  }
}

/* ---- drawing on paper ---- */

function fit(canvas, scale) {
  const width = Math.round(canvas.clientWidth * scale), height = Math.round(canvas.clientHeight * scale);
  if (canvas.width === width && canvas.height === height) return false;
  Object.assign(canvas, { width, height });
  return true;
}

function paper(canvas) {
  const scale = Math.min(window.devicePixelRatio || 1, 2);
  fit(canvas, scale);
  const draw = canvas.getContext("2d");
  draw.setTransform(scale, 0, 0, scale, 0, 0);
  draw.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
  return draw;
}

const FONT = 'system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';

/** Commanded tips (open rings) and simulated ones (dots, filled in stance), with the names of the legs. */
function drawMarks(canvas, scene, recording, pose, row, theme) {
  const draw = paper(canvas), tips = item(recording.tips, pose), planned = item(recording.planned_tips, pose);
  const centre = item(recording.centre_of_mass, pose);
  draw.lineWidth = 1.5;
  draw.strokeStyle = theme.css.centre;
  const [above, below] = [scene.seen(centre), scene.seen([centre[0], centre[1], recording.level[pose]])];
  draw.beginPath();
  draw.moveTo(...above);
  draw.lineTo(...below);
  draw.stroke();
  draw.font = `600 11px ${FONT}`;
  draw.textAlign = "center";
  draw.textBaseline = "middle";
  const middle = scene.seen(centre);
  recording.legs.forEach((name, leg) => {
    const stands = recording.stance[6 * row + leg];
    const [x, y] = scene.seen(planned.subarray(3 * leg, 3 * leg + 3));
    draw.strokeStyle = theme.css.planned;
    draw.lineWidth = 2;
    draw.beginPath();
    draw.arc(x, y, 6, 0, 2 * Math.PI);
    draw.stroke();
    const [u, v] = scene.seen(tips.subarray(3 * leg, 3 * leg + 3));
    draw.beginPath();
    draw.arc(u, v, 3, 0, 2 * Math.PI);
    draw.lineWidth = 1.5;
    draw.strokeStyle = draw.fillStyle = recording.physical ? theme.css.grounded : theme.css.planned;
    if (stands) draw.fill(); else { draw.fillStyle = theme.css.paper; draw.fill(); draw.stroke(); }
    const away = Math.hypot(u - middle[0], v - middle[1]) || 1;
    const a = u + 20 * (u - middle[0]) / away, b = v + 20 * (v - middle[1]) / away;
    draw.beginPath();
    draw.roundRect(a - 12, b - 8, 24, 16, 4);
    draw.fillStyle = stands ? theme.css.ink : theme.css.raised;
    draw.strokeStyle = theme.css.ink;
    draw.lineWidth = 1;
    draw.fill();
    draw.setLineDash(stands ? [] : [3, 2]);
    draw.stroke();
    draw.setLineDash([]);
    draw.fillStyle = stands ? theme.css.raised : theme.css.ink;
    draw.fillText(name, a, b + 0.5);
  });
}

/** Return about `count` round numbers within an interval. */
function ticks(low, high, count) {
  const power = 10 ** Math.floor(Math.log10((high - low) / count));
  const step = [1, 2, 5, 10].map((one) => one * power).find((one) => (high - low) / one <= count);
  const found = [];
  for (let one = Math.ceil(low / step) * step; one <= high + 1e-9 * step; one += step) found.push(one);
  return found;
}

class Chart {
  constructor(canvas, recording) {
    const { begin, end } = recording;
    Object.assign(this, { canvas, recording, begin, end, left: 42, right: 8, still: document.createElement("canvas") });
  }

  column(seconds) {
    return this.left + (seconds - this.begin) / (this.end - this.begin) * (this.canvas.clientWidth - this.left - this.right);
  }

  seconds(column) {
    const part = (column - this.left) / (this.canvas.clientWidth - this.left - this.right);
    return this.begin + Math.min(Math.max(part, 0), 1) * (this.end - this.begin);
  }

  draw(seconds, theme) {
    const { canvas, still } = this, draw = paper(canvas);
    const key = `${canvas.width} ${canvas.height} ${theme.dark}`;
    if (key !== this.key) {
      Object.assign(still, { width: canvas.width, height: canvas.height });
      this.key = key;
      this.drawStill(still.getContext("2d"), theme);
    }
    draw.drawImage(still, 0, 0, canvas.clientWidth, canvas.clientHeight);
    const x = this.column(Math.min(Math.max(seconds, this.begin), this.end)), row = this.recording.row(seconds), margin = this.recording.margin[row];
    draw.strokeStyle = draw.fillStyle = theme.css.ink;
    draw.lineWidth = 1.5;
    draw.beginPath();
    draw.moveTo(x, 0);
    draw.lineTo(x, this.bottom);
    draw.stroke();
    if (!Number.isFinite(margin)) return;
    draw.beginPath();
    draw.arc(x, this.height(margin), 4, 0, 2 * Math.PI);
    draw.fill();
  }

  height(margin) {
    const part = (Math.min(Math.max(margin, this.low), this.high) - this.low) / (this.high - this.low);
    return this.bottom - part * (this.bottom - this.top);
  }

  drawStill(draw, theme) {
    const { canvas, recording } = this, width = canvas.clientWidth, height = canvas.clientHeight, css = theme.css;
    draw.setTransform(canvas.width / width, 0, 0, canvas.height / height, 0, 0);
    draw.font = `11px ${FONT}`;
    draw.textBaseline = "middle";
    const leg = Math.min((0.46 * height) / 6, 34);
    Object.assign(this, { top: 6 * leg + 16, bottom: height - 34 });
    recording.legs.forEach((name, i) => {
      const y = i * leg;
      draw.fillStyle = css.ink;
      draw.textAlign = "right";
      draw.fillText(name, this.left - 8, y + leg / 2);
      draw.fillStyle = css.rule;
      draw.fillRect(this.left, y + leg - 0.5, width - this.left - this.right, 1);
      const off = (stance) => (row) => !stance[6 * row + i] && !(stance === recording.grounded_stance && Number.isNaN(recording.margin[row]));
      draw.fillStyle = css.planned;
      const main = recording.physical ? 0.6 * leg : 0.8 * leg;
      if (recording.physical) this.bars(draw, off(recording.planned_stance), y + 0.72 * leg, 0.18 * leg);
      draw.fillStyle = recording.physical ? css.grounded : css.planned;
      this.bars(draw, off(recording.stance), y + 0.1 * leg, main - 0.05 * leg);
    });
    const known = [...recording.planned_margin, ...recording.margin].filter(Number.isFinite);
    let low = 0, high = 0;
    for (const one of known) { low = Math.min(low, one); high = Math.max(high, one); }
    const room = 0.06 * (high - low) || 1;
    Object.assign(this, { low: low - room, high: high + room });
    this.axes(draw, css, width, height);
    this.line(draw, recording.planned_margin, css.planned, [5, 3]);
    if (recording.physical) this.line(draw, recording.margin, css.grounded, []);
    this.event(draw, recording.lost, "lost", css.lost, css);
    this.event(draw, recording.fell, "fell", css.lost, css);
  }

  bars(draw, on, y, height) {
    const { seconds, step } = this.recording;
    for (let first = 0; first < seconds.length; first++) {
      if (!on(first)) continue;
      let last = first;
      while (last + 1 < seconds.length && on(last + 1)) last++;
      const x = this.column(seconds[first] - step);
      draw.fillRect(x, y, Math.max(this.column(seconds[last]) - x, 0.75), height);
      first = last;
    }
  }

  axes(draw, css, width, height) {
    const zero = this.height(0), wide = width - this.left - this.right;
    draw.save();
    draw.beginPath();
    draw.rect(this.left, zero, wide, this.bottom - zero);
    draw.clip();
    draw.strokeStyle = css.rule;
    draw.lineWidth = 1.5;
    for (let x = this.left - height; x < width; x += 7) {
      draw.beginPath();
      draw.moveTo(x, this.bottom);
      draw.lineTo(x + height, this.bottom - height);
      draw.stroke();
    }
    draw.restore();
    draw.lineWidth = 1;
    draw.strokeStyle = draw.fillStyle = css.faint;
    draw.strokeRect(this.left, this.top, wide, this.bottom - this.top);
    draw.beginPath();
    draw.moveTo(this.left, zero);
    draw.lineTo(width - this.right, zero);
    draw.stroke();
    draw.textAlign = "right";
    for (const one of ticks(this.low, this.high, 6)) draw.fillText(String(+one.toPrecision(6)).replace("-", "\u2212"), this.left - 6, this.height(one));
    draw.textAlign = "center";
    for (const one of ticks(1000 * this.begin, 1000 * this.end, Math.max(wide / 70, 2))) {
      const x = this.column(one / 1000);
      draw.fillRect(x, this.bottom, 1, 4);
      if (x < width - 16) draw.fillText(String(+one.toPrecision(6)), x, this.bottom + 12);
    }
    draw.fillText("time [ms]", this.left + wide / 2, height - 7);
    draw.save();
    draw.translate(7, (this.top + this.bottom) / 2);
    draw.rotate(-Math.PI / 2);
    draw.fillText("margin [mm]", 0, 0);
    draw.restore();
  }

  line(draw, margins, colour, dash) {
    const { seconds } = this.recording;
    draw.strokeStyle = colour;
    draw.lineWidth = 1.6;
    draw.setLineDash(dash);
    draw.beginPath();
    let on = false;
    margins.forEach((margin, row) => {
      if (Number.isNaN(margin)) { on = false; return; }
      const x = this.column(seconds[row]), y = this.height(margin);
      if (on) draw.lineTo(x, y); else draw.moveTo(x, y);
      on = true;
    });
    draw.stroke();
    draw.setLineDash([]);
  }

  event(draw, seconds, word, colour, css) {
    if (seconds === null || seconds > this.end) return;
    const x = this.column(seconds), right = x > this.canvas.clientWidth - 60;
    draw.strokeStyle = draw.fillStyle = colour;
    draw.lineWidth = 1.5;
    draw.setLineDash([2, 3]);
    draw.beginPath();
    draw.moveTo(x, 0);
    draw.lineTo(x, this.bottom);
    draw.stroke();
    draw.setLineDash([]);
    draw.textAlign = right ? "right" : "left";
    draw.font = `600 11px ${FONT}`;
    const at = word === "fell" ? this.bottom - 22 : this.bottom - 9;
    draw.lineWidth = 4;
    draw.strokeStyle = css.paper;
    draw.strokeText(word, x + (right ? -4 : 4), at);
    draw.fillText(word, x + (right ? -4 : 4), at);
    draw.font = `11px ${FONT}`;
  }
}

/* ---- the page ---- */

function themeNow() {
  const style = getComputedStyle(document.documentElement), css = {}, theme = { css };
  for (const name of ["paper", "raised", "ink", "faint", "rule", "sky", "floor", "grid", "planned", "grounded", "stable", "lost", "centre"]) {
    css[name] = style.getPropertyValue(`--${name}`).trim();
    theme[name] = [1, 3, 5].map((at) => parseInt(css[name].slice(at, at + 2), 16) / 255);
  }
  return Object.assign(theme, { dark: css.paper });
}

const fixed = (number, digits) => number.toFixed(digits).replace("-", "\u2212");

class Panel {
  constructor(recording, root) {
    const part = document.getElementById("panel").content.cloneNode(true);
    this.part = (name) => this.root.querySelector(`.${name}`);
    root.append(part);
    this.root = root.lastElementChild;
    this.recording = recording;
    this.root.querySelector("h1").textContent = recording.title || "A walk";
    this.part("conditions").textContent = recording.conditions;
    this.part("world").setAttribute("aria-label", "The walk in 3D; arrow keys turn it, plus and minus zoom");
    this.part("chart").setAttribute("aria-label", "Footfall diagram and stability margin over time");
    this.part("legend").textContent = recording.physical
      ? "bars: foot off the ground; thin: planned swing. Margin: line grounded, dashes planned; hatched: outside the polygon"
      : "bars: planned swing. Margin: dashes planned; hatched: outside the polygon";
    if (!recording.physical) this.root.style.setProperty("--grounded", "var(--planned)");
    this.chart = new Chart(this.part("chart"), recording);
    const tips = item(recording.tips, 0), centre = item(recording.centre_of_mass, 0);
    this.size = Math.max(...[0, 1, 2, 3, 4, 5].map((leg) => Math.hypot(tips[3 * leg] - centre[0], tips[3 * leg + 1] - centre[1])));
    try { this.scene = new Scene(this.part("world"), recording, 14 * this.size); } catch (error) {
      console.warn(error);
      this.part("complaint").hidden = false;
    }
  }

  draw(seconds, view, theme) {
    const { recording } = this, row = recording.row(seconds), pose = recording.pose(row), margin = recording.margin[row];
    const fallen = Number.isNaN(margin), stable = margin > 0;
    const shown = this.part("margin");
    shown.value = String(margin);
    shown.textContent = fallen ? "margin unknown" : Number.isFinite(margin) ? `margin ${margin >= 0 ? "+" : ""}${fixed(margin, 2)} mm` : "no foot stands";
    const part = recording.part.replaceAll("_", " ");
    this.part("word").textContent = fallen ? `\u2716 fell on ${part}` : stable ? "\u2713 within the polygon" : "\u2716 outside the polygon";
    this.part("state").classList.toggle("lost", !stable);
    this.part("now").textContent = `V = ${fixed(recording.velocity[row], 2)}, ${fixed(recording.seconds[row] * recording.vp, 1)} time units; ${recording.happened}`;
    this.chart.draw(seconds, theme);
    if (!this.scene) return;
    const centre = item(recording.centre_of_mass, pose), target = [centre[0], centre[1], recording.level[pose] + 0.12 * this.size];
    const away = view.distance * this.size;
    const flat = away * Math.cos(view.rise);
    const eye = [target[0] + flat * Math.cos(view.turn), target[1] + flat * Math.sin(view.turn), target[2] + away * Math.sin(view.rise)];
    this.scene.draw(pose, !fallen && recording.margin[recording.rows[pose]] > 0, eye, target, this.size, theme);
    drawMarks(this.part("marks"), this.scene, recording, pose, recording.rows[pose], theme);
  }
}

function main() {
  const recordings = JSON.parse(document.getElementById("recordings").textContent).map((one) => new Recording(one));
  document.title = recordings.map((one) => one.title).filter(Boolean).join(" and ") || "A walk";
  const begin = Math.min(...recordings.map((one) => one.begin)), end = Math.max(...recordings.map((one) => one.end));
  const step = Math.min(...recordings.map((one) => one.step));
  const root = document.getElementById("panels");
  root.style.setProperty("--panels", recordings.length);
  root.classList.add(`panels-${recordings.length}`);
  const panels = recordings.map((one) => new Panel(one, root));
  const [play, slider, clock, speeds, views] = ["play", "time", "clock", "speed", "views"].map((id) => document.getElementById(id));
  const state = { seconds: begin, playing: false, speed: 1 / 2, view: { turn: 0, rise: 0, distance: 3.6 }, theme: themeNow(), stale: true };

  slider.max = Math.round((end - begin) / step);
  for (const one of SPEEDS) speeds.add(new Option(one === 1 ? "real time" : `1/${Math.round(1 / one)} speed`, one, one === 1 / 2, one === 1 / 2));
  const redraw = () => { state.stale = true; };
  const seek = (seconds) => { state.seconds = Math.min(Math.max(seconds, begin), end); redraw(); };
  const setPlaying = (on) => {
    if (on && state.seconds >= end) seek(begin);
    state.playing = on;
    play.classList.toggle("playing", on);
    play.setAttribute("aria-label", on ? "Pause" : "Play");
  };
  const look = (name) => {
    [state.view.turn, state.view.rise] = VIEWS[name];
    pressed(name);
  };
  const pressed = (name) => {
    for (const one of views.children) one.setAttribute("aria-pressed", one.textContent === name);
    redraw();
  };
  for (const name of Object.keys(VIEWS)) {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", textContent: name, onclick: () => look(name) });
    views.append(button);
  }
  const turn = (across, up) => {
    state.view.turn -= across;
    state.view.rise = Math.min(Math.max(state.view.rise + up, 0.02), 1.55);
    pressed("");
  };
  const zoom = (factor) => { state.view.distance = Math.min(Math.max(state.view.distance * factor, 1), 15); redraw(); };

  play.onclick = () => setPlaying(!state.playing);
  slider.oninput = () => seek(begin + slider.valueAsNumber * step);
  speeds.onchange = () => { state.speed = Number(speeds.value); redraw(); };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { state.theme = themeNow(); redraw(); });
  addEventListener("resize", redraw);
  for (const { root: panel, chart } of panels) { hold(panel.querySelector(".world"), turn, zoom); scrub(chart, seek); }
  addEventListener("keydown", (event) => {
    const on = event.target, large = event.shiftKey ? 10 : 1;
    if (event.altKey || event.ctrlKey || event.metaKey || on === speeds) return;
    const inWorld = on.classList?.contains("world");
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.06], ArrowDown: [0, -0.06] };
    const name = Object.keys(VIEWS)[Number(event.key) - 1];
    if (event.key === " " && on.tagName !== "BUTTON") setPlaying(!state.playing);
    else if (inWorld && turns[event.key]) turn(...turns[event.key]);
    else if (event.key === "ArrowLeft") seek(state.seconds - large * step);
    else if (event.key === "ArrowRight") seek(state.seconds + large * step);
    else if (event.key === "Home") seek(begin);
    else if (event.key === "End") seek(end);
    else if (event.key === "+" || event.key === "-") zoom(event.key === "+" ? 0.9 : 1.1);
    else if (name) look(name);
    else return;
    event.preventDefault();
  });

  let before = performance.now();
  function frame(now) {
    const passed = Math.min((now - before) / 1000, 0.25);
    before = now;
    if (state.playing) {
      seek(state.seconds + passed * state.speed);
      if (state.seconds >= end) setPlaying(false);
    }
    if (state.stale) {
      state.stale = false;
      slider.value = Math.round((state.seconds - begin) / step);
      clock.value = `${fixed(1000 * state.seconds, 0)} of ${fixed(1000 * end, 0)} ms`;
      slider.setAttribute("aria-valuetext", `${fixed(1000 * state.seconds, 0)} milliseconds`);
      for (const panel of panels) panel.draw(state.seconds, state.view, state.theme);
    }
    requestAnimationFrame(frame);
  }
  look("corner");
  requestAnimationFrame(frame);
}

/** Turn with one finger or the mouse, zoom with two fingers or the wheel. */
function hold(canvas, turn, zoom) {
  const fingers = new Map();
  const apart = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  };
  canvas.onpointermove = (event) => {
    const old = fingers.get(event.pointerId);
    if (!old) return;
    const wide = fingers.size === 2 && apart();
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (wide) zoom(wide / Math.max(apart(), 1));
    else if (fingers.size === 1) turn((event.clientX - old[0]) / 150, (event.clientY - old[1]) / 150);
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(event.deltaY / 1000)); }, { passive: false });
}

/** Go to the time under the pointer in a chart. */
function scrub(chart, seek) {
  const { canvas } = chart, to = (event) => seek(chart.seconds(event.clientX - canvas.getBoundingClientRect().left));
  canvas.onpointerdown = (event) => { canvas.setPointerCapture(event.pointerId); to(event); };
  canvas.onpointermove = (event) => { if (event.buttons) to(event); };
}

main();
