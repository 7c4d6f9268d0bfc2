"""Maps as source code: look-ups of maps in GLSL, HLSL, WGSL and C, and their textures."""
