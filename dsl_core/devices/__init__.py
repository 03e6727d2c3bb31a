"""What cameras, projectors, stages and spectroradiometers promise, and how rigs of them are found."""
