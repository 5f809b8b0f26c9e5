"""A model file is checked when it is opened, and says in one sentence what does not fit."""

import numpy as np
import pytest
from onnx import TensorProto, helper

from perception.detection.onnx_model import ModelContract, ModelInput, OnnxModel, shipped_model
from perception.errors import ModelError
from tests.faults import fault

CONTRACT = ModelContract(
    metadata={"kind": "depthcn", "classes": "Car"},
    required_keys=("window",),
    inputs={
        "crops": ModelInput(np.uint8, (None, 3, 66, 112)),
        "windows_px": ModelInput(np.float32, (None, 4)),
    },
    outputs=("scores",),
)


def inputs_of(rows):
    crops = np.zeros((rows, 3, 66, 112), np.uint8)
    crops += np.arange(rows, dtype=np.uint8)[:, None, None, None] * 51
    return {"crops": crops, "windows_px": np.arange(4 * rows, dtype=np.float32).reshape(rows, 4)}


@pytest.mark.parametrize("rows", [0, 1, 6])
def test_any_number_of_rows_goes_through_at_once(write_model, rows):
    outputs = OnnxModel(write_model(), CONTRACT)(inputs_of(rows))
    np.testing.assert_allclose(outputs["scores"], np.arange(rows) * 0.2, atol=1e-6)
    np.testing.assert_array_equal(outputs["boxes_px"], inputs_of(rows)["windows_px"])


def test_inputs_without_rows_run_no_network(write_model, monkeypatch):
    """Some releases of ONNX Runtime multiply no matrix without rows."""
    model = OnnxModel(write_model(), CONTRACT)
    monkeypatch.setattr(model, "_session", None)
    outputs = model(inputs_of(0))
    assert {name: array.shape for name, array in outputs.items()} == {
        "scores": (0,),
        "boxes_px": (0, 4),
    }
    assert {array.dtype for array in outputs.values()} == {np.dtype(np.float32)}


def test_file_says_what_it_is(write_model):
    model = OnnxModel(write_model(), CONTRACT)
    assert model.metadata["classes"] == "Car"
    assert model.inputs["crops"] == ModelInput(np.uint8, (None, 3, 66, 112))


def test_a_fact_is_one_of_those_known(write_model):
    model = OnnxModel(write_model(), CONTRACT)
    assert model.metadata_choice("classes", ["Van", "Car"]) == "Car"
    with pytest.raises(ModelError) as error:
        model.metadata_choice("classes", ["Van", "Tram"])
    assert (error.value.expected, error.value.found) == ("classes Van or Tram", "Car")


def test_output_does_not_depend_on_threads(write_model):
    outputs = [OnnxModel(write_model(), CONTRACT, n)(inputs_of(5))["scores"] for n in (1, 2)]
    np.testing.assert_array_equal(*outputs)


def test_missing_file(tmp_path):
    with pytest.raises(ModelError) as error:
        OnnxModel(tmp_path / "gone.onnx", CONTRACT)
    assert (error.value.where, error.value.expected) == ("gone.onnx", "a model file")


def test_weights_that_do_not_ship():
    with pytest.raises(ModelError) as error:
        OnnxModel(shipped_model("unheard_of"), CONTRACT)
    assert (error.value.where, error.value.expected) == ("unheard_of.onnx", "a model file")


def test_file_of_another_format(tmp_path):
    path = tmp_path / "letter.onnx"
    path.write_text("Dear network,")
    with pytest.raises(ModelError) as error:
        OnnxModel(path, CONTRACT)
    assert (error.value.where, error.value.expected) == (str(path), "a complete ONNX model")


def test_empty_file(tmp_path):
    (tmp_path / "empty.onnx").touch()
    with pytest.raises(ModelError) as error:
        OnnxModel(tmp_path / "empty.onnx", CONTRACT)
    assert error.value.expected == "a complete ONNX model"


@pytest.mark.parametrize("free_axes", [None, ("crops", (2, 3))])
@pytest.mark.parametrize("name", [b"windows_px", b"ReduceMean"])
def test_names_that_are_no_text(write_model, free_axes, name, capfd):
    path = write_model()
    content = path.read_bytes()
    assert name in content
    path.write_bytes(content.replace(name, name[:-1] + b"\xed"))
    with fault(ModelError, str(path), expected="a complete ONNX model", found="'utf-8' codec"):
        OnnxModel(path, free_axes=free_axes)
    assert capfd.readouterr() == ("", "")


def test_operators_of_a_plugin(tmp_path):
    images = helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, 64, 96])
    count = helper.make_tensor_value_info("num_dets", TensorProto.INT32, [1, 1])
    node = helper.make_node("EfficientNMS_TRT", ["images"], ["num_dets"], domain="TRT")
    graph = helper.make_graph([node], "plugin", [images], [count])
    sets = [helper.make_opsetid("", 17), helper.make_opsetid("TRT", 1)]
    model = helper.make_model(graph, opset_imports=sets, ir_version=9)
    path = tmp_path / "plugin.onnx"
    path.write_bytes(model.SerializeToString())
    advice = "or with operators of ONNX alone"
    with fault(ModelError, str(path), "a complete ONNX model", "EfficientNMS_TRT", advice):
        OnnxModel(path)


def test_outputs_left_out_are_not_returned(write_model):
    model = OnnxModel(write_model())
    inputs = inputs_of(2)
    assert [*model(inputs)] == ["scores", "boxes_px"]
    model.leave_out(["scores"])
    np.testing.assert_array_equal(model(inputs)["boxes_px"], inputs["windows_px"])
    assert [*model(inputs)] == ["boxes_px"]


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
def test_truncated_file(write_model, share):
    path = write_model()
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(ModelError) as error:
        OnnxModel(path, CONTRACT)
    assert error.value.where.endswith("tiny.onnx")


@pytest.mark.parametrize(
    ("changes", "expected", "found"),
    [
        ({"kind": "compact"}, "kind depthcn", "compact"),
        ({"classes": "Car,Pedestrian"}, "classes Car", "Car,Pedestrian"),
        ({"without": "kind"}, "kind depthcn", "no such entry in its metadata"),
        ({"without": "window"}, "window in its metadata", "no such entry in its metadata"),
    ],
)
def test_a_model_of_another_kind_is_refused(write_model, changes, expected, found):
    with pytest.raises(ModelError) as error:
        OnnxModel(write_model(**changes), CONTRACT)
    assert (error.value.expected, error.value.found) == (expected, found)


def test_model_with_other_inputs(write_model):
    with pytest.raises(ModelError) as error:
        OnnxModel(write_model(planes=1), CONTRACT)
    assert "crops uint8 any x 3 x 66 x 112" in error.value.expected
    assert "crops uint8 any x 1 x 66 x 112" in error.value.found


def test_model_with_inputs_of_another_type(write_model):
    with pytest.raises(ModelError) as error:
        OnnxModel(write_model(input_type=TensorProto.FLOAT), CONTRACT)
    assert error.value.found.startswith("crops float32 any x 3")
    with pytest.raises(ModelError) as error:
        OnnxModel(write_model(input_type=TensorProto.DOUBLE), CONTRACT)
    assert error.value.found.startswith("crops another type any x 3")


def test_model_without_an_output(write_model):
    contract = ModelContract(CONTRACT.metadata, inputs=CONTRACT.inputs, outputs=("depths",))
    with pytest.raises(ModelError) as error:
        OnnxModel(write_model(), contract)
    assert (error.value.expected, error.value.found) == ("an output depths", "scores, boxes_px")


def test_input_of_another_size(write_model):
    model = OnnxModel(write_model(), CONTRACT)
    small = inputs_of(2) | {"crops": np.zeros((2, 3, 33, 56), np.uint8)}
    with pytest.raises(ModelError) as error:
        model(small)
    assert error.value.expected.startswith("to run on crops (2, 3, 33, 56)")


def test_network_that_yields_nan(write_model):
    # 0 / 0 of black crops, as already the first run has them.
    path = write_model(divisor=0.0)
    with pytest.raises(ModelError) as error:
        OnnxModel(path, CONTRACT)
    assert error.value.expected == "finite numbers in output scores"
    assert error.value.found == "32 that are NaN or infinite"
