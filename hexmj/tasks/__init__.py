"""Tasks: a command, a terrain and events, with which every controller walks; see `task.Task` and `runner.run_task`."""
