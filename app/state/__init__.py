"""What the application knows, without Qt: values that tell when they change."""
