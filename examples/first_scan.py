# %% [markdown]
# # A first scan
#
# The digital twin of the published rig stands for a camera, a projector and a film. This scan is small, so
# that it takes seconds; for a real rig only the name and the options change.

# %%
import dsl_core as dsl

with dsl.open_rig("twin", size="222x145", scene="color-checker") as rig:
    plan = dsl.plan(rig, "quick")
    scan = dsl.scan(rig, "first.dsl", plan)
print(f"{plan.shot_count} frames are in {scan.folder}")

# %% [markdown]
# Frames become a result: depth, points, normals, and a reflectance spectrum with a deviation for every
# pixel. Flags say what limits a pixel; after a quick plan most pixels have one, for a few of their bands.

# %%
result = dsl.reconstruct(scan)
print(result.dsl.verdict)
print(f"{float(result['depth_mm'].notnull().mean()):.0%} of the pixels have a depth")
print(result.dsl.reasons(x=95, y=89))

# %% [markdown]
# A spectrum with its 95 % band, and depth as a picture.

# %%
import matplotlib.pyplot as plt

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3))
result.dsl.plot(x=95, y=89, ax=left)
result["depth_mm"].plot.imshow(ax=right, yincrease=False, cmap="viridis")
figure.savefig("first.png")

# %% [markdown]
# The twin knows the truth, so the errors are known.

# %%
errors = dsl.evaluate(result)
print(f"reflectance of the patches: RMSE {errors.mean('rmse'):.4f}")
