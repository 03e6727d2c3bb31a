"""Which page gets which controller and state; the only module that imports all slices."""
