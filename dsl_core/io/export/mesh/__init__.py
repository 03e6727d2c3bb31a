"""The surface of a result as triangles: glTF, OBJ with its texture, PLY and STL."""
