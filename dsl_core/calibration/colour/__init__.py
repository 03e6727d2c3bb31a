"""Response and emission refined on a Color Checker."""
