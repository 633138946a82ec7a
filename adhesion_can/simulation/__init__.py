"""The locomotive as a plant: wheelsets, train, drive and sensors, out come the frames of a bus."""
