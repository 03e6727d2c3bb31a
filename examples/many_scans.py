# %% [markdown]
# # What accuracy costs
#
# The same object with two plans: what more frames buy. On a real rig the minutes are those of exposures
# and of the projector; the twin renders in seconds.

# %%
import dsl_core as dsl

found = []
with dsl.open_rig("twin", size="64x48", scene="color-checker") as rig:
    for preset in ("preview", "comb"):
        plan = dsl.plan(rig, preset)
        scan = dsl.scan(rig, f"{preset}.dsl", plan)
        result = dsl.reconstruct(scan, bands_nm=(430, 660, 10))
        result.dsl.save(f"{preset}.zarr", overwrite=True)
        seconds = plan.duration_s(rig.projector.info.latency_ms)
        found.append((preset, plan.shot_count, seconds, float(result["reflectance_std"].median())))

for preset, frames, seconds, deviation in found:
    print(f"{preset:8s} {frames:4d} frames, {seconds:5.1f} s on a rig, deviation of a pixel {deviation:.4f}")

# %% [markdown]
# Saved results open again in a later session, and a script that was stopped goes on where it was: a
# finished scan is not captured again.

# %%
again = dsl.load_result("comb.zarr")
print(again["depth_mm"].median().item())
