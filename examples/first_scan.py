# %% [markdown]
# # A first scan
#
# The digital twin of the published rig stands for a camera, a projector and a film. This scan is small, so
# that it ends in seconds; a real one differs by the name of the rig alone.

# %%
import dsl_core as dsl

with dsl.open_rig("twin", size="64x48", scene="color-checker") as rig:
    plan = dsl.plan(rig, "quick")
    scan = dsl.scan(rig, "first.dsl", plan)
print(f"{plan.shot_count} frames are in {scan.folder}")

# %% [markdown]
# Frames become a result: depth, points, normals, and a reflectance spectrum with a deviation for every
# pixel.

# %%
result = dsl.reconstruct(scan)
print(result.dsl.verdict)
print(f"{float(result.dsl.good.mean()):.0%} of the pixels are without any flag")

# %% [markdown]
# A spectrum with its 95 % band, and depth as a picture.

# %%
import matplotlib.pyplot as plt

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3))
result.dsl.plot(x=32, y=20, ax=left)
result["depth_mm"].plot.imshow(ax=right, yincrease=False, cmap="viridis")
figure.savefig("first.png")

# %% [markdown]
# The twin knows the truth, so errors can be told.

# %%
errors = dsl.evaluate(result)
print(f"reflectance of the patches: RMSE {errors.mean('rmse'):.4f}")
