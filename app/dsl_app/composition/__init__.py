"""Which page gets which controller and state; the only place that knows all slices."""
