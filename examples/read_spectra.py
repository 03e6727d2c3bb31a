# %% [markdown]
# # Read spectra
#
# A finished scan comes with the program. Its spectra have a deviation per band, and pixels that are
# limited say why.

# %%
import dsl_core as dsl
from dsl_core.resources import resource_path

result = dsl.load_result(resource_path("examples/color-checker.zarr"))
spectrum = result.dsl.spectrum(x=100, y=100)
for nm in (450, 550, 650):
    band = spectrum.sel(wavelength_nm=nm)
    print(f"{nm} nm: {float(band['reflectance']):.3f} ± {1.96 * float(band['reflectance_std']):.3f}")

# %% [markdown]
# A region has a mean; the deviation is that of its pixels.

# %%
patch = result.dsl.region((92, 92, 16, 16))
middle = float(patch["reflectance"].sel(wavelength_nm=550))
print(f"mean of {patch.attrs['used']} pixels at 550 nm: {middle:.3f}")

# %% [markdown]
# Where is a spectrum like this one? The spectral angle compares shapes, whatever the brightness.

# %%
import numpy as np

cube, one = result["reflectance"].values, patch["reflectance"].values
cosine = np.einsum("bij,b->ij", cube, one) / (np.linalg.norm(cube, axis=0) * np.linalg.norm(one))
angle_rad = np.arccos(np.clip(cosine, -1, 1))
print(f"{np.nanmean(angle_rad < 0.05):.1%} of the pixels have this shape within 0.05 rad")

# %% [markdown]
# Tables and pictures for other programs.

# %%
files = [
    *dsl.export(result, "cube.hdr", overwrite=True),
    *dsl.export(result, "depth.tif", overwrite=True),
]
print(", ".join(path.name for path in files))
