"""Frozen records without algorithms, and the conventions that every other module follows.

Units
    Millimetres, nanometres, milliseconds, pixels, digital numbers (DN); units are in the names.
Frames of reference
    The camera frame is that of OpenCV: x right, y down, z forward. A rig's pose maps camera
    coordinates to projector coordinates, ``x_projector = R x_camera + t``.
Pixels
    Pixel centres are at integer coordinates, so pixel ``i`` covers ``[i - 0.5, i + 0.5)``.
    Images are (rows, columns); colour images end in (3,) = R, G, B; cubes are band first,
    (wavelength, y, x).
Orders
    Order ``m`` moves the projector column seen by a pixel by about ``m * wavelength / period``:
    a pixel lit by column ``q`` through the zero order is lit through order +1 by columns
    right of ``q``, through order -1 by columns left of it.
Radiance and reflectance
    Radiance is linear, black subtracted, in DN per millisecond at full projector drive.
    Reflectance is on the Spectralon scale: 1 is the perfect diffuser.
"""
