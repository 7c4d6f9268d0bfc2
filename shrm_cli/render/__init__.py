"""Pictures of spheres, as a viewer sees them through maps and in front of surroundings."""
