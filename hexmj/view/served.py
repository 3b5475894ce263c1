"""A page of a recording, served on this machine."""

from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from hexmj.view.port import check_port


def page_server(text: str, host: str, port: int) -> ThreadingHTTPServer:
    """A server that answers with one page; `serve_forever` serves it.

    Raises:
        InputError: the port is taken.
    """
    check_port(host, port)
    content = text.encode()

    class Answer(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200 if self.path == "/" else 404)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(content) if self.path == "/" else 0))
            self.end_headers()
            if self.path == "/" and self.command == "GET":
                self.wfile.write(content)

        do_HEAD = do_GET

        def log_message(self, format: str, *args: object) -> None:
            """Nothing is told of who looked."""

    class Server(ThreadingHTTPServer):
        def handle_error(self, request: object, client_address: object) -> None:
            """Who leaves before all is read is no error."""

    return Server((host, port), Answer)
