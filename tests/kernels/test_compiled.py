import subprocess
import sys
from pathlib import Path

import numpy as np

from perception.kernels.compiled import NUMBER, WHOLE, array_of, compiled, written
from tests.full_disk import file_size_limit


def test_a_function_without_a_folder_for_its_cache_is_compiled_all_the_same() -> None:
    names: dict[str, object] = {}
    exec("def doubled(x):\n    return 2 * x", names)
    doubled = compiled((NUMBER,))(names["doubled"])
    assert doubled(1.5) == 3.0


def test_a_function_without_room_for_its_cache_is_compiled_all_the_same() -> None:
    with file_size_limit(1):

        @compiled((NUMBER,))
        def tripled(x: float) -> float:
            return 3 * x

    assert tripled(1.5) == 4.5


def test_one_function_for_several_types() -> None:
    @compiled((array_of(np.float32),), (array_of(np.float64),))
    def first(values: np.ndarray) -> float:
        return values[0]

    for kind in (np.float32, np.float64):
        assert first(np.array([0.5], kind)) == 0.5


def test_a_function_calls_one_that_is_not_loaded_yet() -> None:
    names: dict[str, object] = {}
    exec(
        "def doubled(x):\n    return 2 * x\ndef quadrupled(x):\n    return doubled(doubled(x))",
        names,
    )
    names["doubled"] = compiled((NUMBER,))(names["doubled"])
    assert compiled((NUMBER,))(names["quadrupled"])(1.5) == 6.0


def test_a_function_is_compiled_again_where_one_of_another_file_that_it_calls_has_changed(
    tmp_path: Path,
) -> None:
    head = "from perception.kernels.compiled import NUMBER, compiled\n"
    (tmp_path / "middle.py").write_text(
        f"{head}from called import step\n@compiled((NUMBER,))\ndef middle(x):\n    return step(x)\n"
    )
    (tmp_path / "calling.py").write_text(
        f"{head}from middle import middle\n@compiled((NUMBER,))\ndef twice(x):\n    return 2 * middle(x)\n"
    )
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\nimport calling; print(calling.twice(1.0))"
    results = []
    for factor in (
        3,
        15,
    ):  # of another length: bytecode of the same second and size is taken for current
        (tmp_path / "called.py").write_text(
            f"{head}@compiled((NUMBER,))\ndef step(x):\n    return {factor} * x\n"
        )
        ran = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=True
        )
        results.append(float(ran.stdout))
    assert results == [6.0, 30.0]
    assert len([*(tmp_path / "__pycache__").glob("calling.twice*.nbi")]) == 2


def test_arguments_are_numbers_arrays_and_tuples() -> None:
    @compiled(((WHOLE, NUMBER), array_of(np.bool_, 2), written(np.int64)))
    def fill(numbers: tuple[int, float], is_set: np.ndarray, out: np.ndarray) -> float:
        out[:] = numbers[0]
        return numbers[1] * is_set.sum()

    out, is_set = np.zeros(2, np.int64), np.ones((2, 3), np.bool_)
    is_set.setflags(write=False)
    assert fill((7, 0.5), is_set, out) == 3.0
    assert out.tolist() == [7, 7]


def test_the_pipeline_is_imported_quickly_and_has_loaded_every_function_before_a_frame() -> None:
    code = (
        "import sys\n"
        "from perception.pipeline import Pipeline, PipelineConfig\n"
        "heavy = ('numba', 'scipy.optimize', 'scipy.spatial', 'scipy.ndimage')\n"
        "imported = [name for name in heavy if name in sys.modules]\n"
        "Pipeline(config=PipelineConfig.for_motion()).close()\n"
        "import numba, numpy as np\n"
        "numba.njit = None\n"  # a function that is loaded only now fails
        "from perception.kernels.voxel_table import voxel_moments\n"
        "voxel_moments(np.ones((9, 4), np.float32), 0.5)\n"
        "print(imported)"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"
