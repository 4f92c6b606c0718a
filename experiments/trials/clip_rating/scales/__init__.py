"""The types of scale on which a clip is rated.

A type is a module here and its place in the union, and the widget of its name in
`frontend/src/participant/trials/scales`.
"""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from experiments.trials.clip_rating.scales.points import Points
from experiments.trials.clip_rating.scales.scale import SCALE_NAME, Scale
from experiments.trials.clip_rating.scales.slider import Slider


def _with_type(value: Any) -> Any:
    return {"type": "points", **value} if isinstance(value, dict) and "type" not in value else value


AnyScale = Annotated[Points | Slider, Field(discriminator="type"), BeforeValidator(_with_type)]

__all__ = ["SCALE_NAME", "AnyScale", "Points", "Scale", "Slider"]
