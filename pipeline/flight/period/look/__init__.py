"""What the deputy sees and knows at a sample: light, camera, target, navigation."""
