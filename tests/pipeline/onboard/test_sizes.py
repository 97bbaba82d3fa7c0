"""Stacks from a call graph, as GCC writes one."""

import pytest

from pipeline.onboard.sizes import stacks_of

GRAPH = """graph: { title: "controller.c"
node: { title: "controller.c:leaf" label: "leaf\\ncontroller.c:1:1\\n24 bytes (static)" }
node: { title: "sin" label: "sin\\nmath.h:2:1" shape : ellipse }
node: { title: "controller.c:middle" label: "middle\\ncontroller.c:3:1\\n100 bytes (static)" }
edge: { sourcename: "controller.c:middle" targetname: "controller.c:leaf" label: "controller.c:4:1" }
edge: { sourcename: "controller.c:middle" targetname: "sin" label: "controller.c:5:1" }
node: { title: "step" label: "step\\ncontroller.c:6:1\\n8 bytes (static)" }
edge: { sourcename: "step" targetname: "controller.c:middle" label: "controller.c:7:1" }
edge: { sourcename: "step" targetname: "controller.c:leaf" label: "controller.c:8:1" }
}"""


def test_a_stack_is_the_deepest_chain_of_frames():
    frames, stacks = stacks_of(GRAPH)
    assert frames == {"leaf": 24, "middle": 100, "step": 8}
    assert stacks == {"leaf": 24, "middle": 124, "step": 132}


def test_a_frame_that_grows_up_to_a_bound_counts_with_it():
    bounded = GRAPH.replace("100 bytes (static)", "100 bytes (dynamic,bounded)")
    assert stacks_of(bounded) == stacks_of(GRAPH)


def test_frames_without_a_constant_bound_and_circles_are_refused():
    with pytest.raises(ValueError, match="frame of middle is dynamic"):
        stacks_of(GRAPH.replace("100 bytes (static)", "100 bytes (dynamic)"))
    circle = 'edge: { sourcename: "controller.c:leaf" targetname: "step" label: "" }\n}'
    with pytest.raises(ValueError, match="calls itself"):
        stacks_of(GRAPH[:-1] + circle)
