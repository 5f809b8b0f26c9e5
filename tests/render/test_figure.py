import pytest

from perception.render.figure import new_figure, save_figure

PNG, PDF = b"\x89PNG", b"%PDF"


@pytest.mark.parametrize(
    ("name", "begin"), [("masks.png", PNG), ("masks", PNG), ("masks.v2", PNG), ("masks.PDF", PDF)]
)
def test_a_figure_has_the_format_of_its_name_or_is_a_png(tmp_path, name, begin):
    save_figure(new_figure(2, 1, "masks"), tmp_path / "results" / name)
    assert (tmp_path / "results" / name).read_bytes().startswith(begin)
