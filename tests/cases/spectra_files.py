"""Files as spectral instruments and their programs write them, made here from one known spectrum."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np

from dsl_core.io.spectra.catalogue import read_spectra
from dsl_core.io.spectra.reference_file import shares_of
from dsl_core.io.spectra.spectrum_file import as_radiance, of_kind

NM = np.arange(400.0, 701.0, 10.0)
SHARE = 0.2 + 0.5 * np.exp(-0.5 * ((NM - 560) / 45) ** 2)
COUNTS = np.round(9000 + 20 * (NM - 400))


def asd(
    revision: bytes = b"as7",
    kind: int = 0,
    white: bool = True,
    values: np.ndarray | None = None,
    counts: np.ndarray = COUNTS,
    nm: np.ndarray = NM,
) -> bytes:
    """A binary file of ASD: counts and a white reference."""
    head = bytearray(484)
    head[:3] = revision
    head[3:20] = b"leaf in the field"
    struct.pack_into("<ffxxxxxH", head, 191, nm[0], nm[1] - nm[0], nm.size)
    head[186], head[199] = kind, 2
    body = (SHARE * COUNTS if values is None else values).astype("<f8").tobytes()
    text = b"white tile"
    block = struct.pack("<H16xH", 1 if white else 0, len(text)) + text + counts.astype("<f8").tobytes()
    return bytes(head) + body + (block if revision not in (b"ASD", b"asd") else b"")


def sig(units: str = "Radiance, Radiance") -> str:
    """A file of SVC: reference, target, and reflectance in percent, detectors overlapping."""
    rows = [f"{nm:.1f}  {1e4:.2f}  {1e4 * r:.4f}  {100 * r:.4f}" for nm, r in zip(NM, SHARE, strict=True)]
    rows.insert(20, "575.0  1.00  1.00  1.00")  # the next detector begins before the last one ends
    head = [
        "/*** Spectra Vista SIG Data ***/",
        "name= leaf.sig",
        "instrument= HI: 1124",
        "integration= 100, 90",
    ]
    return "\r\n".join([*head, f"units= {units}", "data= ", *rows])


def sed(columns: str = "Rad. (Ref.)\tRad. (Target)\tReflect. %", units: str = "") -> str:
    """A file of Spectral Evolution: reference, target, and reflectance in percent."""
    rows = [f"{nm:.1f}\t{0.1:.6e}\t{0.1 * r:.6e}\t{100 * r:.5f}" for nm, r in zip(NM, SHARE, strict=True)]
    head = [
        "Comment: ",
        "Version: 2.3 [1.2.6250C]",
        "Instrument: PSR-3500_SN1 [3]",
        "Measurement: REFLECTANCE",
    ]
    head += [f"Units: {units}"] if units else []
    return "\r\n".join([*head, "Columns [4]:", "Data:", f"Wvl\t{columns}", *rows, ""])


def ocean(said: str = "Data from Reflectance_USB2000 Node", scale: float = 100.0) -> str:
    """Text of OceanView."""
    rows = [f"{nm:.3f}\t{scale * r:.5f}" for nm, r in zip(NM, SHARE, strict=True)]
    head = [said, "", "Date: Mon Nov 16 10:00:00 2026", "Integration Time (sec): 1.000000E-1"]
    head += ["Electric dark correction enabled: true", "XAXIS mode: Wavelengths"]
    return "\n".join(
        [*head, f"Number of Pixels in Spectrum: {NM.size}", ">>>>>Begin Spectral Data<<<<<", *rows]
    )


def avantes(last: str = "Reflectance", unit: str = "[%]") -> str:
    """Text of AvaSoft, with decimal commas."""
    rows = [
        f" {nm:.2f};{c * r:9.3f};{0:9.3f};{c:9.3f};{100 * r:.5f}".replace(".", ",")
        for nm, r, c in zip(NM, SHARE, COUNTS, strict=True)
    ]
    head = ["", "Integration time [ms]:  15,000", "Averaging Nr. [scans]: 10", "Smoothing Nr. [pixels]: 0"]
    head += [
        "Data measured with spectrometer [name]: 1204091U1",
        f"Wave   ;Sample   ;Dark     ;Reference;{last}",
    ]
    return "\r\n".join([*head, f"[nm]   ;[counts] ;[counts] ;[counts] ;{unit}", "", *rows])


def konica_minolta(lines: bool = True) -> str:
    """An export of a CS-2000: a measurement a line, or a measurement a column."""
    if lines:
        labels = ",".join(f"{nm:.0f}nm" for nm in NM)
        rows = [f"No.{k},2026/11/16,{','.join(f'{r * k / 100:.6e}' for r in SHARE)}" for k in (1, 2)]
        return "\r\n".join(["CS-2000,Ver 1.5", "", f"Data No.,Date,{labels}", *rows])
    rows = [f"{nm:.0f},{r / 100:.6e}" for nm, r in zip(NM, SHARE, strict=True)]
    return "\r\n".join(["Instrument,CS-2000A", "Lv,120.4", "Speed,Normal", *rows])


def jcamp(form: str = "plain") -> str:
    """JCAMP-DX over falling wavenumbers in pairs, or over nm plainly, or compressed."""
    head = [
        "##TITLE=leaf",
        "##JCAMP-DX=4.24 $$ made by hand",
        "##DATA TYPE=UV/VIS SPECTRUM",
        "##YUNITS=REFLECTANCE",
    ]
    if form == "pairs":
        pairs = [f"{1e7 / nm:.6f}, {r:.8f};" for nm, r in zip(NM, SHARE, strict=True)]
        return "\n".join([*head, "##XUNITS=1/CM", "##XYPOINTS=(XY..XY)", *pairs, "##END="])
    whole = np.round(SHARE * 1e5).astype(int)
    head += [
        "##XUNITS=NANOMETERS",
        "##FIRSTX=400",
        "##LASTX=700",
        f"##NPOINTS={NM.size}",
        "##YFACTOR=0.00001",
    ]
    lines = []
    for at in range(0, NM.size, 8):
        part = whole[at : at + 8]
        if form == "plain":
            lines.append(" ".join(str(v) for v in (int(NM[at]), *part)))
        else:  # differences; a line begins with the value on which the last one ended
            first = part if at == 0 else np.concatenate([[whole[at - 1]], part])
            lines.append(f"{NM[at]:.0f}" + _squeezed(int(first[0])) + "".join(map(_step, np.diff(first))))
    return "\n".join([*head, "##XYDATA=(X++(Y..Y))", *lines, "##END="])


def _squeezed(value: int) -> str:
    return "@ABCDEFGHI"[int(str(value)[0])] + str(value)[1:]


def _step(value: int) -> str:
    digits = str(abs(value))
    return ("%jklmnopqr" if value < 0 else "%JKLMNOPQR")[int(digits[0])] + digits[1:]


def cgats(kind: str = "", norm: str = "") -> str:
    """A table of X-Rite's programs, or (``kind`` and ``norm``) of ArgyllCMS."""
    scale = float(norm or 1) * (1000 if kind == "EMISSION" else 1)
    fields = " ".join(f"SPEC_{nm:.0f}" for nm in NM)
    rows = [f'{k} "patch {k}" ' + " ".join(f"{scale * r * k:.6f}" for r in SHARE / 10) for k in (1, 2)]
    head = ["CGATS.17", 'ORIGINATOR "i1Profiler"', f"NUMBER_OF_FIELDS {NM.size + 2}"]
    head += [f'MEAS_TYPE "{kind}"', f'SPECTRAL_NORM "{norm}"'] if kind else []
    head += [f'SPECTRAL_BANDS "{NM.size}"', 'SPECTRAL_START_NM "400"', 'SPECTRAL_END_NM "700"']
    table = ["BEGIN_DATA_FORMAT", f"SAMPLE_ID SAMPLE_NAME {fields}", "END_DATA_FORMAT", "NUMBER_OF_SETS 2"]
    return "\n".join([*head, *table, "BEGIN_DATA", *rows, "END_DATA", ""])


def light_meter(label: str = "Spectral Data {:.0f}[nm]") -> str:
    """An export of a hand-held light meter: figures of the light, then the spectrum coarsely and finely."""
    head = ["Title,lamp 3262 K", "", "Viewing Angle [°],2", "Peak Wavelength [nm],560", "SSI1,---", ""]
    fine = [f"{label.format(nm)},{r / 100:.9f}" for nm, r in zip(NM, SHARE, strict=True)]
    return "\r\n".join([*head, *fine[::3], "", *fine, ""])


def tm27(quantity: str = "reflectance") -> str:
    """A document of the lighting industry."""
    values = [
        f'<SpectralData wavelength="{nm:.1f}">{r:.6f}</SpectralData>' for nm, r in zip(NM, SHARE, strict=True)
    ]
    head = ['<?xml version="1.0"?>', '<IESTM2714 xmlns="iestm2714" version="1.0">']
    head += ["<Header><Description>leaf</Description></Header><SpectralDistribution>"]
    said = f"<SpectralQuantity>{quantity}</SpectralQuantity>"
    return "\n".join([*head, said, *values, "</SpectralDistribution></IESTM2714>", ""])


#: A file of each kind by the name under which it is found.
SPECTRA_FILES: dict[str, str | bytes] = {
    "leaf.asd": asd(),
    "leaf.sig": sig(),
    "leaf.sed": sed(),
    "ocean.txt": ocean(),
    "avantes.txt": avantes(),
    "cs2000.csv": konica_minolta(),
    "plain.jdx": jcamp(),
    "packed.jdx": jcamp("packed"),
    "pairs.dx": jcamp("pairs"),
    "patches.cgats": cgats(),
    "meter.csv": light_meter(),
    "leaf.spdx": tm27(),
}


def write(path: Path, content: str | bytes) -> Path:
    """Write a file of spectra and return its path."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return path


def write_all(folder: Path) -> None:
    """Write a file of each kind."""
    for name, content in SPECTRA_FILES.items():
        write(folder / name, content)


def reader_of(name: str) -> Callable[[Path], object]:
    """What reads the file of that name in a folder, as far as its values."""

    def read(folder: Path) -> object:
        path = folder / name
        found = read_spectra(path)
        if "meter" in name:
            # Irradiance is neither radiance nor a share.
            return found
        if "cs2000" in name:
            return [as_radiance(path, each) for each in of_kind(path, found, radiance=True)]
        return shares_of(path, found)

    return read
