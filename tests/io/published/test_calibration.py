"""The published calibration folder: tables, lenses, and what is missing of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.errors import CalibrationError, StoreError
from dsl_core.io.published.calibration import check_calibration, export_calibration, load_calibration
from dsl_core.io.published.curve_tables import load_tables, save_tables
from dsl_core.model.rig import ColumnResidual, FlatField, Rig
from dsl_core.model.spectral import SpectralCurve, WavelengthGrid
from dsl_core.workflows.exchange import import_calibration
from tests.cases.small_rig import small_rig

BANDS = WavelengthGrid().centres_nm
#: Red, green and blue, (bands, 3).
CENTRED = np.exp(-(((BANDS[:, None] - np.array([620.0, 540.0, 460.0])) / 40) ** 2))


def test_a_rig_comes_back_from_the_published_files(tmp_path: Path) -> None:
    rig = small_rig()
    files = export_calibration(rig, tmp_path)
    assert [f.relative_to(tmp_path).as_posix() for f in files] == [
        "dataset/image_formation/CRF.npy",
        "dataset/image_formation/PEF.npy",
        "dataset/image_formation/DG.npy",
        "calibration/calibration_propcam.xml",
    ]
    again = load_calibration(tmp_path).rig(rig.model_copy(update={"white_scale": 7.0}))
    assert (again.camera, again.projector, again.pose) == (rig.camera, rig.projector, rig.pose)
    assert again.white_scale == 7.0
    assert "small" in again.provenance.notes
    for name in ("response", "emission"):
        for old, new in zip(getattr(rig, name), getattr(again, name), strict=True):
            np.testing.assert_allclose(new.at(BANDS), old.at(BANDS), rtol=1e-12)
    for order in (-1, 0, 1):
        np.testing.assert_allclose(
            again.efficiency[order].at(BANDS), rig.efficiency[order].at(BANDS), rtol=1e-12
        )
    assert {r.status for r in check_calibration(tmp_path)} == {"ok", "optional"}


def test_what_the_base_measured_of_its_own_lenses_and_curves_is_left_out(tmp_path: Path) -> None:
    rig = small_rig()
    export_calibration(rig, tmp_path)
    measured = {
        "residual": ColumnResidual(
            orders=(1,),
            degrees=((0, 0, 0, 0),),
            column_range_px=(0, 63),
            row_range_px=(0, 47),
            depth_range_mm=(600, 900),
            wavelength_range_nm=(400, 700),
            coefficients_px=((1.0,),),
        ),
        "flat_field": FlatField(rows_px=(0.0,), columns_px=(0.0, 63.0), gain=((0.9, 1.0),)),
        "geometry_covariance": (0.0,) * 576,
        "column_std_px": 0.011,
        "chain_rel_std": SpectralCurve.of([400.0, 700.0], [0.002, 0.002]),
        "white_scale_rel_std": 0.001,
        "reference_rel_std": 0.0025,
    }
    again = load_calibration(tmp_path).rig(rig.model_copy(update=measured))
    bare = {name: getattr(again, name) for name in measured}
    assert bare == {name: Rig.model_fields[name].default for name in measured}
    assert again.film == rig.film
    assert "without its residual columns, flat field, covariance" in again.provenance.notes
    assert "without" not in load_calibration(tmp_path).rig(rig).provenance.notes


def test_tables_have_the_shapes_that_the_published_code_reads(tmp_path: Path) -> None:
    rig = small_rig()
    save_tables(rig, tmp_path)
    response, emission, efficiency = (np.load(tmp_path / f"{name}.npy") for name in ("CRF", "PEF", "DG"))
    assert response.shape == emission.shape == (47, 3)
    assert efficiency.shape == (3, 47)
    np.testing.assert_allclose(response[:, 2], rig.response[2].at(BANDS))
    np.testing.assert_allclose(efficiency[0], rig.efficiency[-1].at(BANDS))
    np.testing.assert_allclose(efficiency[2], rig.efficiency[1].at(BANDS))


@pytest.mark.parametrize(
    ("bands", "first", "last"), [(47, 430, 660), (24, 430, 660), (25, 420, 660), (29, 400, 680)]
)
def test_the_number_of_bands_tells_the_wavelengths(tmp_path: Path, bands: int, first: int, last: int) -> None:
    # Names of earlier versions, for a change.
    for name, shape in (("CRF_cam", (bands, 3)), ("CRF_proj", (bands, 3)), ("intensity_dg", (3, bands))):
        np.save(tmp_path / f"{name}.npy", np.ones(shape))
    curve = load_tables(tmp_path)[2][1]
    assert (curve.wavelengths_nm[0], curve.wavelengths_nm[-1], len(curve.values)) == (first, last, bands)


def _tables(folder: Path, **changes: NDArray[np.generic]) -> None:
    tables = {"CRF": np.ones((47, 3)), "PEF": np.ones((47, 3)), "DG": np.ones((3, 47))}
    for name, table in (tables | changes).items():
        np.save(folder / f"{name}.npy", table)


@pytest.mark.parametrize(
    ("name", "table", "says"),
    [
        ("CRF", np.ones((3, 47)), r"CRF\.npy has shape \(3, 47\); \(bands, 3\)"),
        ("DG", np.ones((47, 3)), r"DG\.npy has shape \(47, 3\); \(3, bands\)"),
        ("PEF", np.ones((47, 3, 1)), r"PEF\.npy has shape"),
        ("PEF", np.ones((31, 3)), r"31 bands; published tables have 24, 25, 29, 47\. Resample"),
        (
            "CRF",
            CENTRED[:, ::-1],
            r"CRF\.npy: red, green and blue \(in the order of columns\) are centred at",
        ),
        ("PEF", CENTRED[::-1], r"red must have the longest wavelength"),
        ("PEF", np.zeros((47, 3)), "is zero throughout"),
        ("DG", np.full((3, 47), 25.0), "in percent by 100"),
        ("CRF", np.full((47, 3), np.nan), "negative or non-finite"),
        ("DG", np.full((3, 47), -1.0), "negative or non-finite"),
        ("CRF", np.full((47, 3), "x"), "a single array of numbers"),
    ],
)
def test_wrong_tables_are_refused(tmp_path: Path, name: str, table: NDArray[np.generic], says: str) -> None:
    _tables(tmp_path, **{name: table})
    with pytest.raises(CalibrationError, match=says):
        load_tables(tmp_path)


def test_curves_of_any_scale_give_the_same_rig(tmp_path: Path) -> None:
    """Published tables hold what an instrument or a maker counts in, such as 0 to 255."""
    rig = small_rig()
    export_calibration(rig, tmp_path)
    for name, factor in (("CRF", 255.0), ("PEF", 1e-3)):
        table = tmp_path / "dataset" / "image_formation" / f"{name}.npy"
        np.save(table, factor * np.load(table))
    again = load_calibration(tmp_path).rig(rig)
    for old, new in zip((*rig.response, *rig.emission), (*again.response, *again.emission), strict=True):
        np.testing.assert_allclose(new.at(BANDS), old.at(BANDS), rtol=1e-9)


def test_lengths_in_metres_are_refused_or_read_as_such(tmp_path: Path) -> None:
    rig = small_rig()
    there = rig.pose.model_copy(update={"translation_mm": tuple((rig.pose.vector_mm / 1000).tolist())})
    export_calibration(rig.model_copy(update={"pose": there}), tmp_path)
    with pytest.raises(CalibrationError, match=r"makes no rig.*more than 1 mm apart.*--unit-mm 1000"):
        import_calibration(tmp_path, rig, None)
    found, doubts = import_calibration(tmp_path, rig, None, unit_mm=1000.0)
    assert found.pose.vector_mm == pytest.approx(rig.pose.vector_mm)
    assert not doubts


def test_lenses_of_another_projector_are_doubted(tmp_path: Path) -> None:
    rig = small_rig()
    own = rig.projector
    export_calibration(
        rig.model_copy(update={"projector": own.resized(3 * own.width_px, 3 * own.height_px)}), tmp_path
    )
    _, doubts = import_calibration(tmp_path, rig, None)
    assert "projector's principal point" in doubts[0]
    found, doubts = import_calibration(tmp_path, rig, None, (3 * own.width_px, 3 * own.height_px))
    assert (found.projector.width_px, doubts) == (3 * own.width_px, [])


def test_unreadable_and_missing_tables(tmp_path: Path) -> None:
    _tables(tmp_path)
    (tmp_path / "CRF.npy").write_bytes(b"no array")
    with pytest.raises(CalibrationError, match=r"CRF\.npy is not an array"):
        load_tables(tmp_path)
    (tmp_path / "CRF.npy").unlink()
    with pytest.raises(CalibrationError, match=r"CRF\.npy does not exist"):
        load_tables(tmp_path)


def test_a_rig_without_first_orders_cannot_be_exported(tmp_path: Path) -> None:
    rig = small_rig()
    rig = rig.model_copy(update={"efficiency": {0: rig.efficiency[0]}})
    with pytest.raises(CalibrationError, match=r"no efficiency of order -1"):
        export_calibration(rig, tmp_path)
    export_calibration(small_rig(), tmp_path)
    with pytest.raises(StoreError, match="already exists"):
        export_calibration(small_rig(), tmp_path)


def test_the_table_says_what_to_do(tmp_path: Path) -> None:
    export_calibration(small_rig(), tmp_path)
    (tmp_path / "calibration" / "calibration_propcam.xml").rename(tmp_path / "calibration" / "result.xml")
    tables = tmp_path / "dataset" / "image_formation"
    (tables / "CRF.npy").rename(tables / "CRF_cam.npy")
    (tables / "DG.npy").unlink()
    table = {r.expected.split("/")[-1]: r for r in check_calibration(tmp_path)}
    assert (table["calibration_propcam.xml"].status, table["calibration_propcam.xml"].found) == (
        "misnamed",
        "calibration/result.xml",
    )
    assert (
        "rename calibration/result.xml to calibration_propcam.xml" in table["calibration_propcam.xml"].advice
    )
    assert table["CRF.npy"].status == "misnamed"
    assert table["PEF.npy"].status == "ok"
    assert table["DG.npy"].status == "missing"
    assert table["first_order_correspondence_model.npy"].status == "optional"
    assert [r.status for r in check_calibration(tmp_path / "nowhere")] == ["missing"] * 4 + ["optional"]


def test_a_calibration_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    """New tables beside old lenses would be taken for one rig."""
    rig = small_rig()
    *tables, lenses = export_calibration(rig, tmp_path)
    for path in tables:
        path.unlink()
    with pytest.raises(StoreError, match="already exists"):
        export_calibration(rig, tmp_path)
    assert not any(path.exists() for path in tables)
    assert len(export_calibration(rig, tmp_path, overwrite=True)) == 4
    assert lenses.exists()
