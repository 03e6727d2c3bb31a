"""The desktop application of dsl-scan: what the user sees, on top of the headless `dsl_core`."""
