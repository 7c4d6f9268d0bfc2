"""Maps as source code: functions that look a map up in GLSL, HLSL and C, and their textures."""
