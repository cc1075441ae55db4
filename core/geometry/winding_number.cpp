namespace remesh {}
