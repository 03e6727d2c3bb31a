"""What a setting of a calibration may be: a person is told of another value before anything is captured."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

#: The least and most that a white target reflects; less is none, more is given in percent.
LEAST_REFLECTANCE, MOST_REFLECTANCE = 0.02, 1.05

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
#: How many times as long a second exposure is as the first one; 1 for none.
Ratio = Annotated[float, Field(ge=1, allow_inf_nan=False)]
Reflectance = Annotated[float, Field(ge=LEAST_REFLECTANCE, le=MOST_REFLECTANCE, allow_inf_nan=False)]
RelativeStd = Annotated[float, Field(ge=0, lt=0.2, allow_inf_nan=False)]
#: The centre of a bandpass filter in what a camera of silicon sees, nm.
FilterNm = Annotated[float, Field(ge=300, le=1100, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1)]
