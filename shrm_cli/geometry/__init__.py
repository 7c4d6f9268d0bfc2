"""Triangle meshes from files, their normals and tangents, and the rays that find them."""
