"""Every format gives back the points that were written, and says in one sentence what is malformed."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pypcd4
import pytest

from data.clouds.cloud import require_column_names, seconds_of
from data.clouds.file_bytes import MAX_SCAN_BYTES
from data.clouds.pcd import read_viewpoint
from data.clouds.read_cloud import read_cloud
from data.clouds.rows_file import columns_in_rows
from perception.errors import PerceptionError, ScanError
from tests.faults import fault

_REPORTED = Path(__file__).parents[4] / "shared" / "bug_reports"
N = 50
NAMES = ("x", "y", "z", "intensity", "ring", "t")
TYPES = (np.float32, np.float32, np.float32, np.float32, np.uint16, np.uint32)


@pytest.fixture
def columns():
    """Return the columns of a scan with times in nanoseconds over 0.1 s."""
    random = np.random.default_rng(0)
    xyz = random.normal(0, 20, (N, 3)).astype(np.float32)
    rest = (np.linspace(0, 255, N), np.arange(N) % 16, np.linspace(0, 99_999_999, N))
    return dict(zip(NAMES, (*xyz.T, *rest), strict=True))


def records(columns, types=TYPES):
    array = np.zeros(N, list(zip(NAMES, types, strict=True)))
    for name, values in columns.items():
        array[name] = values
    return array


def pcd_header(array, data, **other):
    rows = {
        "VERSION": "0.7",
        "FIELDS": " ".join(array.dtype.names),
        "SIZE": " ".join(str(array.dtype[n].itemsize) for n in array.dtype.names),
        "TYPE": " ".join(array.dtype[n].kind.upper() for n in array.dtype.names),
        "WIDTH": len(array),
        "HEIGHT": 1,
        "POINTS": len(array),
        **other,
        "DATA": data,
    }
    return "".join(f"{key} {value}\n" for key, value in rows.items()).encode()


def text_rows(array, delimiter=" "):
    return "".join(delimiter.join(repr(v.item()) for v in row) + "\n" for row in array).encode()


def ply_header(array, form):
    kinds = {"f4": "float", "u2": "ushort", "u4": "uint"}
    rows = [f"property {kinds[array.dtype[n].str[1:]]} {n}" for n in array.dtype.names]
    lines = ["ply", f"format {form} 1.0", f"element vertex {len(array)}", *rows, "end_header"]
    return ("\n".join(lines) + "\n").encode()


def write_npz(path, **arrays):
    np.savez_compressed(path, **arrays)


def write_compressed_pcd(path, columns):
    cloud = pypcd4.PointCloud.from_points(
        [columns[n].astype(t) for n, t in zip(NAMES, TYPES, strict=True)], NAMES, TYPES
    )
    cloud.save(path, encoding=pypcd4.Encoding.BINARY_COMPRESSED)


WRITERS = {
    "rows.bin": lambda p, a, c: p.write_bytes(np.column_stack([*c.values()]).astype(np.float32).tobytes()),
    "records.npy": lambda p, a, c: np.save(p, a),
    "rows.npy": lambda p, a, c: np.save(p, np.column_stack([*c.values()])),
    "fortran.npy": lambda p, a, c: np.save(p, np.asfortranarray(np.column_stack([*c.values()]))),
    "columns.npz": lambda p, a, c: write_npz(p, **c),
    "rows.npz": lambda p, a, c: write_npz(p, points=np.column_stack([*c.values()])),
    "mixed.npz": lambda p, a, c: write_npz(
        p, xyz=np.column_stack([c["x"], c["y"], c["z"]]), reflectivity=c["intensity"],
        laser_number=c["ring"], offset_ns=c["t"], stamp=np.int64(7),
    ),
    "ascii.pcd": lambda p, a, c: p.write_bytes(pcd_header(a, "ascii") + text_rows(a)),
    "binary.pcd": lambda p, a, c: p.write_bytes(pcd_header(a, "binary") + a.tobytes()),
    "compressed.pcd": lambda p, a, c: write_compressed_pcd(p, c),
    "ascii.ply": lambda p, a, c: p.write_bytes(ply_header(a, "ascii") + text_rows(a)),
    "little.ply": lambda p, a, c: p.write_bytes(ply_header(a, "binary_little_endian") + a.tobytes()),
    "big.ply": lambda p, a, c: p.write_bytes(
        ply_header(a, "binary_big_endian") + a.astype(a.dtype.newbyteorder(">")).tobytes()
    ),
    "names.csv": lambda p, a, c: p.write_bytes(b"x,y,z,Intensity,ring,t\n" + text_rows(a, ",")),
    "comment.csv": lambda p, a, c: p.write_bytes(b"# x [m];y [m];z [m];i;laser_id;time\n" + text_rows(a, ";")),
    "bare.csv": lambda p, a, c: p.write_bytes(text_rows(a, " ")),
}  # fmt: skip


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_points_back(name, columns, tmp_path):
    path = tmp_path / name
    WRITERS[name](path, records(columns), columns)
    cloud = read_cloud(path, NAMES if name == "rows.bin" else None)
    assert cloud.xyz.dtype == np.float32
    for axis in range(3):
        np.testing.assert_array_equal(cloud.xyz[:, axis], columns["xyz"[axis]])
    np.testing.assert_array_equal(cloud.intensity, columns["intensity"].astype(np.float32))
    np.testing.assert_array_equal(cloud.ring, columns["ring"])
    np.testing.assert_allclose(cloud.times_s, np.floor(columns["t"]) * 1e-9, atol=1e-8)


def test_a_cloud_without_optional_columns_has_none(tmp_path):
    np.save(tmp_path / "a.npy", np.ones((4, 3)))
    cloud = read_cloud(tmp_path / "a.npy")
    assert (len(cloud), cloud.intensity, cloud.ring, cloud.times_s) == (4, None, None, None)


def test_names_may_be_given_and_columns_left_out(tmp_path):
    np.save(tmp_path / "a.npy", np.arange(14.0).reshape(2, 7))
    cloud = read_cloud(tmp_path / "a.npy", ["_", "z", "y", "x", "_", "ring", "_"])
    np.testing.assert_array_equal(cloud.xyz, [[3, 2, 1], [10, 9, 8]])
    np.testing.assert_array_equal(cloud.ring, [5, 12])


def test_a_pcd_field_of_several_numbers_is_stepped_over(tmp_path):
    array = np.zeros(3, [("x", "f4"), ("y", "f4"), ("normal", "f4", 3), ("z", "f4"), ("_", "u1")])
    array["z"] = [1, 2, 3]
    header = pcd_header(
        np.zeros(3, "f4,f4,f4,f4,u1"), "binary", FIELDS="x y normal z _", COUNT="1 1 3 1 1"
    )
    (tmp_path / "a.pcd").write_bytes(header + array.tobytes())
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.pcd").xyz[:, 2], [1, 2, 3])


def compressed(array):
    """Return columns one behind the other, stored as they are."""
    columns = b"".join(array[name].tobytes() for name in array.dtype.names)
    return np.array([len(columns)] * 2, "u4").tobytes() + columns


PCD_DATA = {
    "ascii": text_rows,
    "binary": lambda a: a.tobytes(),
    "binary_compressed": compressed,
}


@pytest.mark.parametrize("data", PCD_DATA)
@pytest.mark.parametrize("kind", ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"])
def test_pcd_fields_are_of_any_type_in_any_order(kind, data, tmp_path):
    array = np.zeros(3, [("t", "u8"), ("z", kind), ("rgb", "f4"), ("x", kind), ("y", kind)])
    array["x"], array["y"], array["z"] = [1, 2, 3], [4, 5, 6], [7, 8, 127]
    array["t"] = 1_700_000_000_000_000_000 + np.array([0, 50_000_000, 100_000_000])
    (tmp_path / "a.pcd").write_bytes(pcd_header(array, data) + PCD_DATA[data](array))
    cloud = read_cloud(tmp_path / "a.pcd")
    np.testing.assert_array_equal(cloud.xyz, [[1, 4, 7], [2, 5, 8], [3, 6, 127]])
    np.testing.assert_allclose(np.diff(cloud.times_s), 0.05, atol=1e-6)


@pytest.mark.parametrize("data", PCD_DATA)
def test_a_pcd_field_of_count_0_takes_no_bytes(data, tmp_path):
    array = np.zeros(3, [("x", "f4"), ("y", "f4"), ("z", "f4"), ("intensity", "f4")])
    array["z"], array["intensity"] = [1, 2, 3], [4, 5, 6]
    fields = {
        "FIELDS": "_ x y z _ intensity",
        "SIZE": "8 4 4 4 1 4",
        "TYPE": "U F F F U F",
        "COUNT": "0 1 1 1 0 1",
    }
    header = pcd_header(array, data, **fields)
    (tmp_path / "a.pcd").write_bytes(header + PCD_DATA[data](array))
    cloud = read_cloud(tmp_path / "a.pcd")
    np.testing.assert_array_equal(cloud.xyz[:, 2], [1, 2, 3])
    np.testing.assert_array_equal(cloud.intensity, [4, 5, 6])


@pytest.mark.parametrize(
    "header",
    [
        "COLUMNS x y z\nPOINTS 2\nDATA ascii\n",
        "# made by hand\r\nFIELDS x y z\r\nWIDTH 2\r\nHEIGHT 1\r\nDATA ascii\r\n",
        "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 0\nHEIGHT 0\nPOINTS 2\nDATA ASCII\n",
        "VERSION .7\nFIELDS x y z\nWIDTH 1\nHEIGHT 2\nVIEWPOINT 0 0 0 0 0 0 0\nDATA ascii\n",
    ],
)
def test_a_pcd_header_may_lack_what_follows_from_the_rest(header, tmp_path):
    (tmp_path / "a.pcd").write_bytes(header.encode() + b"1 2 3\n4 5 6\n")
    cloud = read_cloud(tmp_path / "a.pcd")
    np.testing.assert_array_equal(cloud.xyz, [[1, 2, 3], [4, 5, 6]])
    assert cloud.viewpoint is None


def test_the_viewpoint_of_a_pcd_is_translation_and_quaternion_w_first(tmp_path):
    half = np.sqrt(0.5)
    header = pcd_header(POINT, "binary", VIEWPOINT=f"1 2 3 {half} {half} 0 0")
    (tmp_path / "a.pcd").write_bytes(header + POINT.tobytes())
    about_x = [[1, 0, 0, 1], [0, 0, -1, 2], [0, 1, 0, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(read_cloud(tmp_path / "a.pcd").viewpoint, about_x, atol=1e-12)
    np.testing.assert_allclose(read_viewpoint(tmp_path / "a.pcd"), about_x, atol=1e-12)


@pytest.mark.parametrize("name", ["count_0", "compressed_stored_plain", "viewpoint"])
def test_pcd_files_that_others_stumbled_over(name):
    if not _REPORTED.is_dir():
        pytest.skip("the inputs of bug reports are not here")
    expected = np.loadtxt(_REPORTED / "expected_xyz.csv", delimiter=",", skiprows=1)
    cloud = read_cloud(_REPORTED / f"{name}.pcd")
    np.testing.assert_allclose(cloud.xyz, expected, atol=1e-6)
    assert (cloud.viewpoint is not None) == (name == "viewpoint")


@pytest.mark.parametrize("count", [3, 4, 5, 6])
def test_the_columns_of_a_bin_file_are_found(count, tmp_path):
    angle = np.linspace(0, 6, 600)
    rows = np.column_stack(
        [
            9 * np.cos(angle),
            9 * np.sin(angle),
            angle / 9,
            angle * 0 + 20,
            np.arange(600) % 32,
            angle,
        ]
    )
    (tmp_path / "a.bin").write_bytes(rows[:, :count].astype(np.float32).tobytes())
    assert columns_in_rows(tmp_path / "a.bin") == count


@pytest.mark.parametrize(
    ("values", "name", "expected"),
    [
        (np.array([0, 50_000_000, 99_000_000]), "t", [0, 0.05, 0.099]),
        (np.array([0, 50_000, 99_000]), "time", [0, 0.05, 0.099]),
        (np.array([0, 0.05, 0.099]), "time", [0, 0.05, 0.099]),
        (np.array([0, 1000.0]), "offset_us", [0, 0.001]),
        (np.array([1.0, np.nan, 1.1]), "t", [1.0, np.nan, 1.1]),
        (np.array([7, 7]), "t", None),
    ],
)
def test_times_are_in_seconds(values, name, expected):
    seconds = seconds_of(values, name)
    assert seconds is expected or np.allclose(seconds, expected, equal_nan=True)


def npy(array, shape=None, descr=None):
    file = io.BytesIO()
    header = {"descr": descr or "<f4", "fortran_order": False, "shape": shape or array.shape}
    np.lib.format.write_array_header_1_0(file, header)
    return file.getvalue() + array.astype("f4").tobytes()


def zipped(content, name="a.npy"):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, content)
    return file.getvalue()


ROWS = np.ones((5, 4), np.float32)
POINT = records(dict.fromkeys(NAMES, 1))
MALFORMED = {
    "short.bin": (ROWS.tobytes()[:-3], "16 bytes a point: x, y, z, intensity as float32", "77"),
    "large.npy": (npy(ROWS, shape=(10**9, 4)), "4000000000 points", "80 bytes"),
    "objects.npy": (npy(ROWS, descr="|O"), "numbers", "Python objects"),
    "flat.npy": (npy(ROWS.ravel()), "(N, C) array", "shape (20,)"),
    "two.npy": (npy(ROWS[:, :2]), "3 to 6 columns", "2 columns"),
    "no-columns.npy": (npy(ROWS, shape=(3, 0, 0)), "3 to 6 columns", "0 columns"),
    "negative.npy": (npy(ROWS, shape=(-5, -4)), "20 points", "80 bytes"),
    "nested.npy": (npy(ROWS, descr=("<f4", (2,))), "numbers", "the type ('<f4', (2,))"),
    "sizeless.npy": (npy(ROWS, descr="|V0"), "numbers", "the type |V0"),
    "uneven.npy": (
        npy(ROWS, shape=(5,), descr=[("x", "<f4"), ("y", "<f4", (2,)), ("z", "<f4")]),
        "one number a point",
        "y float32 (10,)",
    ),
    "text.npy": (b"hello", "an array of NumPy", "magic"),
    "empty.npy": (b"", "an array of NumPy", ""),
    "many.npy": (npy(np.ones((5, 9))), "3 to 6 columns", "9 columns"),
    "text.npz": (b"hello", "a .npz archive", "not a zip file"),
    "cut.npz": (zipped(npy(ROWS))[:-20], "a .npz archive", ""),
    "names.npz": (zipped(npy(ROWS[:, :1].ravel()), "q.npy"), "(N, C) array", "shape (5,)"),
    "text.pcd": (b"hello\n", "the header of a PCD file", "DATA"),
    "sizes.pcd": (pcd_header(POINT, "binary", SIZE="4 4"), "a SIZE, a TYPE", "argument"),
    "kind.pcd": (pcd_header(POINT, "binary", TYPE="F F F Q U U"), "a SIZE, a TYPE", "'Q'"),
    "count.pcd": (pcd_header(POINT, "binary", POINTS=7), "WIDTH times HEIGHT", "POINTS 7"),
    "minus.pcd": (pcd_header(POINT, "binary", COUNT="1 1 1 1 1 -1"), "a COUNT", "COUNT -1"),
    "pointless.pcd": (b"FIELDS x y z\nWIDTH 3\nDATA ascii\n", "a PCD header", "nor POINTS"),
    "viewpoint.pcd": (pcd_header(POINT, "binary", VIEWPOINT="0 0 0 1"), "a PCD header", "VIEWPOINT 0 0 0 1"),
    "form.pcd": (pcd_header(POINT, "zipped"), "ascii, binary, binary_compressed", "zipped"),
    "cut.pcd": (pcd_header(POINT, "binary") + b"abc", "50 points of 22 bytes", "3 bytes"),
    "less.pcd": (pcd_header(POINT, "binary_compressed") + b"abc", "50 points", "0 bytes"),
    "bad.pcd": (
        pcd_header(POINT, "binary_compressed") + np.array([4, 1100], "u4").tobytes() + b"\xff" * 4,
        "LZF", "",
    ),
    "rows.pcd": (pcd_header(POINT, "ascii") + b"1 2 3 4 5 6\n", "50 rows of 6", "1 rows of 6"),
    "words.pcd": (pcd_header(POINT, "ascii") + b"a b c d e f\n", "rows of numbers", "a"),
    "none.pcd": (pcd_header(POINT, "ascii"), "50 points", "0 bytes"),
    "names.pcd": (
        pcd_header(POINT, "binary", FIELDS="a b c d e f") + POINT.tobytes(), "columns x, y and z", "a, b",
    ),
    "text.ply": (b"hello\nend_header\n", "PLY header", "another format"),
    "endless.ply": (b"ply\n" * 9, "the header of a PLY file", "none that ends"),
    "list.ply": (
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty list uchar int a\nend_header\n",
        "one number a property", "a list",
    ),
    "faces.ply": (b"ply\nformat ascii 1.0\nelement face 1\nend_header\n", "vertices", "face"),
    "kind.ply": (
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty q x\nend_header\n", "vertices", "'q'",
    ),
    "bare.ply": (
        b"ply\nformat binary_little_endian 1.0\nelement vertex 99999999999999999999\nend_header\n",
        "one number a property", "vertices without a property",
    ),
    "cut.ply": (ply_header(POINT, "binary_little_endian") + b"abc", "50 points", "3 bytes"),
    "rows.ply": (ply_header(POINT, "ascii") + b"1 2 3 4 5 6\n", "50 rows of 6", "1 rows"),
    "words.csv": (b"x,y,z\n1,2,q\n", "rows of numbers", "q"),
    "names.csv": (b"x,y\n1,2,3\n", "a name for each column", "2 names and 1 rows of 3"),
    "empty.csv": (b"", "rows of numbers", "0 names"),
    "coded.csv": (b"\xff\xfe\x00", "a table as text", "utf-8"),
    "a.las": (b"", "a file of .bin, .npy, .npz, .pcd, .ply, .csv", ".las"),
}  # fmt: skip


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_file_is_one_sentence(name, tmp_path):
    content, expected, found = MALFORMED[name]
    path = tmp_path / name
    path.write_bytes(content)
    with fault(ScanError, where=str(path), expected=expected, found=found):
        read_cloud(path)


def test_a_missing_file_is_one_sentence(tmp_path):
    with fault(ScanError, where="a.pcd", expected="a scan", found="no file"):
        read_cloud(tmp_path / "a.pcd")


def test_archives_that_grow_beyond_any_scan_are_refused_before_they_do(tmp_path):
    path = tmp_path / "bomb.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("a.npy", "w") as file,
    ):
        for _ in range((MAX_SCAN_BYTES >> 20) + 1):
            file.write(bytes(1 << 20))
    assert path.stat().st_size < 1 << 20
    with fault(ScanError, where=str(path), expected="at most 512 MiB", found="513 MiB"):
        read_cloud(path)


def test_headers_and_files_beyond_any_scan_are_refused(tmp_path):
    header = pcd_header(POINT, "binary_compressed", WIDTH=10**8, POINTS=10**8)
    (tmp_path / "a.pcd").write_bytes(header)
    with fault(ScanError, expected="at most 512 MiB"):
        read_cloud(tmp_path / "a.pcd")
    with (tmp_path / "a.bin").open("wb") as file:
        file.truncate(MAX_SCAN_BYTES + 16)
    with fault(ScanError, expected="at most 512 MiB"):
        read_cloud(tmp_path / "a.bin")


def test_columns_of_another_number_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", ROWS)
    with fault(ScanError, expected="3 columns, x, y, z", found="4"):
        read_cloud(tmp_path / "a.npy", ["x", "y", "z"])


@pytest.mark.parametrize("names", [["x", "y"], ["x", "y", "z", "q"], ["x", "y", "z", "z"]])
def test_names_of_columns_are_validated(names):
    with fault(PerceptionError, where="--columns", expected="x, y, z", found=", ".join(names)):
        require_column_names(names, "--columns")
    require_column_names(["x", "y", "z", "_", "_", "Reflectivity"], "--columns")


def test_a_cut_file_of_every_format_is_a_scan_error(columns, tmp_path):
    """No cut gives another error than a sentence; text may end at the end of a row."""
    for name, write in WRITERS.items():
        path = Path(tmp_path / name)
        write(path, records(columns), columns)
        whole = path.read_bytes()
        for end in range(0, len(whole), 97):
            path.write_bytes(whole[:end])
            try:
                read_cloud(path)
            except ScanError:
                continue
