"""A server that refuses the first call of each method for now, and hands on all others."""

import contextlib
from concurrent import futures

from google.protobuf import any_pb2
import grpc


def details():
    """A google.rpc.Status that says when to come again."""
    retry = any_pb2.Any(type_url="type.googleapis.com/google.rpc.RetryInfo").SerializeToString()
    return b"\x1a" + bytes([len(retry)]) + retry


class Handler(grpc.GenericRpcHandler):
    def __init__(self, server):
        self.server = server
        self.known = []

    def service(self, call):
        def answer(requests, context):
            if call.method not in self.known:
                self.known.append(call.method)
                if len(self.known) % 2 == 0:
                    context.abort(grpc.StatusCode.UNAVAILABLE, "starting")
                context.set_trailing_metadata((("grpc-status-details-bin", details()),))
                context.abort(grpc.StatusCode.RESOURCE_EXHAUSTED, "too many at a time")
            yield from self.server.stream_stream(call.method)(requests)

        return grpc.stream_stream_rpc_method_handler(answer)


@contextlib.contextmanager
def before(address):
    """The address of one that hands on to another server."""
    with futures.ThreadPoolExecutor(8) as threads, grpc.insecure_channel(address) as channel:
        server = grpc.server(threads, handlers=[Handler(channel)])
        port = server.add_insecure_port("127.0.0.1:0")
        server.start()
        yield f"127.0.0.1:{port}"
        server.stop(None).wait()
