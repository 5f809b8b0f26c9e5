import numpy as np
from numba import types

from perception.kernels.compiled import NUMBER, array_of, compiled
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
    @compiled((array_of(types.float32),), (array_of(types.float64),))
    def first(values: np.ndarray) -> float:
        return values[0]

    for kind in (np.float32, np.float64):
        assert first(np.array([0.5], kind)) == 0.5
