"""The graph of the detector from above in a form that predicts the same numbers at four fifths of the cost.

    trunk ──┬── score head ── scores ── blocks with a score that counts
            └── 3x3 blocks around each of these ── box head ── boxes

A twelfth of the blocks of a scan has such a score, and no box is read elsewhere. What is upsampled is copied: by ONNX
Runtime's operator, numbers of 8 bits take ten times as long.
"""

from collections.abc import Mapping
from typing import Any

import onnx

from perception.detection.bev.boxes import MIN_LOGIT

_BLOCKS = """
blocks_of (float scores, float features) => (int64 blocks, float around, float middles) {{
  zero = Constant <value_ints = [0]> ()
  zero_number = Constant <value_float = 0.0> ()
  one = Constant <value_ints = [1]> ()
  best = ReduceMax <keepdims = 0> (scores, one)
  floor = Constant <value_float = {floor!r}> ()
  counts = GreaterOrEqual (best, floor)
  found = NonZero (counts)
  first = Constant <value = int64[3, 1] {{0, 0, 0}}> ()
  places = Concat <axis = 1> (first, found)
  steps = Constant <value = int64[3, 1] {{{steps}}}> ()
  steps_of_places = Mul (places, steps)
  blocks = ReduceSum <keepdims = 0> (steps_of_places, zero)
  last = Transpose <perm = [0, 2, 3, 1]> (features)
  margins = Constant <value_ints = [0, 1, 1, 0, 0, 1, 1, 0]> ()
  padded = Pad (last, margins, nothing)
  flat_shape = Constant <value_ints = [-1, {channels}]> ()
  flat = Reshape (padded, flat_shape)
  padded_steps = Constant <value = int64[3, 1] {{{padded_steps}}}> ()
  padded_steps_of_places = Mul (places, padded_steps)
  corners = ReduceSum (padded_steps_of_places, zero)
  two = Constant <value_ints = [2]> ()
  corners_of_rows = Unsqueeze (corners, two)
  offsets = Constant <value = int64[3, 1, 3] {{{offsets}}}> ()
  numbers = Add (corners_of_rows, offsets)
  gathered = Gather (flat, numbers)
  image_shape = Constant <value_ints = [1, 3, -1, {channels}]> ()
  image = Reshape (gathered, image_shape)
  around = Transpose <perm = [0, 3, 1, 2]> (image)
  from = Constant <value_ints = [1, 1]> ()
  to = Constant <value_ints = [2, 9223372036854775807]> ()
  axes = Constant <value_ints = [2, 3]> ()
  strides = Constant <value_ints = [1, 3]> ()
  middles = Slice (around, from, to, axes, strides)
}}
"""
_COPIES = """
copies_of (uint8 small) => (uint8 large) {{
  last = Transpose <perm = [0, 2, 3, 1]> (small)
  single_shape = Constant <value_ints = [0, 0, 0, 1, -1]> ()
  single = Reshape (last, single_shape)
  twice = Concat <axis = 3> (single, single)
  line_shape = Constant <value_ints = [0, 0, 1, -1]> ()
  lines = Reshape (twice, line_shape)
  lines_twice = Concat <axis = 2> (lines, lines)
  large_shape = Constant <value_ints = [0, {rows}, {columns}, {channels}]> ()
  large_last = Reshape (lines_twice, large_shape)
  large = Transpose <perm = [0, 3, 1, 2]> (large_last)
}}
"""


def streamlined(model: bytes) -> bytes:
    """Return a model file that predicts the same numbers at less cost: boxes where a score counts, and a list of these.

    Args:
        model: File with outputs scores (B, K S S, H, W) and boxes (B, 16 S S, H, W) of whole maps.

    Returns:
        The file with boxes (1, 16 S S, 1, P) of P blocks and their (P,) numbers, `blocks`, of the B H W.
    """
    made = onnx.load_from_string(model)
    graph = made.graph
    shapes = {
        entry.name: [axis.dim_value for axis in entry.type.tensor_type.shape.dim]
        for entry in (*graph.value_info, *graph.output)
    }
    _upsample_by_copies(graph, shapes)
    _predict_where_scored(graph, shapes)
    del graph.value_info[:]
    onnx.checker.check_model(made, full_check=True)
    return bytes(made.SerializeToString())


def _upsample_by_copies(graph: Any, shapes: Mapping[str, list[int]]) -> None:  # noqa: ANN401 - made by protobuf
    """Copy the numbers of 8 bits that are upsampled as they are."""
    makers = _makers(graph)
    for back in list(graph.node):
        large = makers.get(back.input[0]) if back.op_type == "QuantizeLinear" else None
        small = makers.get(large.input[0]) if large and large.op_type == "Resize" else None
        if large is None or small is None or small.input[1:] != back.input[1:]:
            continue
        _, channels, rows, columns = shapes[large.output[0]]
        text = _COPIES.format(rows=rows, columns=columns, channels=channels)
        nodes = _parsed(text, {"small": small.input[0], "large": back.output[0]}, large.name)
        at = list(graph.node).index(back)
        for number, node in enumerate(nodes):
            graph.node.insert(at + number, node)
        for node in (back, large, small):
            graph.node.remove(node)


def _predict_where_scored(graph: Any, shapes: Mapping[str, list[int]]) -> None:  # noqa: ANN401 - made by protobuf
    """Predict boxes of the blocks with a score that counts, and of the first block, as no layer takes none."""
    makers = _makers(graph)
    scoring = _nodes_to("scores", makers)
    branch = [node for node in graph.node if not scoring & set(node.output)]
    depthwise = next(node for node in branch if node.op_type == "Conv")
    trunk, back = depthwise.input[0], makers[depthwise.input[0]]
    is_quantized = back.op_type == "DequantizeLinear"
    features = back.input[0] if is_quantized else trunk
    _, channels, rows, columns = shapes[makers[features].input[0] if is_quantized else trunk]
    offsets = [i * (columns + 2) + j for i in range(3) for j in range(3)]
    text = _BLOCKS.format(
        floor=MIN_LOGIT, channels=channels,
        steps=f"{rows * columns}, {columns}, 1",
        padded_steps=f"{(rows + 2) * (columns + 2)}, {columns + 2}, 1",
        offsets=", ".join(map(str, offsets)),
    )  # fmt: skip
    outer = {"scores": "scores", "features": features, "blocks": "blocks"}
    # What is beyond the border is 0, in numbers of 8 bits the number that stands for it.
    outer["nothing"] = back.input[2] if is_quantized else "boxes/zero_number"
    nodes = _parsed(text, outer, "boxes")
    for part in ("around", "middles"):
        name = f"boxes/{part}"
        if is_quantized:
            nodes.append(
                onnx.helper.make_node(
                    "DequantizeLinear", [name, *back.input[1:]], [f"{name}/number"]
                )
            )
        for node in branch:
            if trunk in node.input and (node is depthwise) == (part == "around"):
                node.input[list(node.input).index(trunk)] = (
                    nodes[-1].output[0] if is_quantized else name
                )
    for attribute in depthwise.attribute:
        if attribute.name in ("pads", "strides"):
            attribute.ints[:] = [0] * 4 if attribute.name == "pads" else [3, 3]
    ordered = [*(node for node in graph.node if scoring & set(node.output)), *nodes, *branch]
    del graph.node[:]
    graph.node.extend(ordered)
    graph.output.append(onnx.helper.make_tensor_value_info("blocks", onnx.TensorProto.INT64, ["P"]))
    boxes = next(entry for entry in graph.output if entry.name == "boxes").type.tensor_type.shape
    boxes.dim[0].dim_value, boxes.dim[2].dim_value, boxes.dim[3].dim_param = 1, 1, "P"


def _makers(graph: Any) -> dict[str, Any]:  # noqa: ANN401 - made by protobuf
    return {output: node for node in graph.node for output in node.output}


def _nodes_to(name: str, makers: Mapping[str, Any]) -> set[str]:
    """Return the names of a value and of all that it is made of."""
    found, waiting = set[str](), [name]
    while waiting:
        one = waiting.pop()
        if one not in found:
            found.add(one)
            waiting.extend(makers[one].input if one in makers else ())
    return found


def _parsed(text: str, outer: Mapping[str, str], prefix: str) -> list[Any]:
    """Return the nodes of a graph with the names of the graph around in place of some, and a prefix to the others."""
    nodes = list(onnx.parser.parse_graph(text).node)
    for node in nodes:
        for names in (node.input, node.output):
            names[:] = [outer.get(name, f"{prefix}/{name}") for name in names]
    return nodes
