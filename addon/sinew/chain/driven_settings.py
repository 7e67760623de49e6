"""The settings of modifiers that drivers set, computed in the hook: Blender may evaluate these drivers later.

The hook has copies of the drivers' variables, which Blender evaluates before it calls Sinew.
"""

import ctypes
import math
from typing import Any

from ..host import contract
from ..plan import driven, drivers, plans, wiring
from .leaving import LeaveToBlender


class WithSettings:
    """A modifier with some of its settings replaced by other values."""

    def __init__(self, modifier: Any, settings: dict[str, Any]) -> None:
        self._modifier, self._settings = modifier, settings

    def __getattr__(self, name: str) -> Any:
        return self._settings[name] if name in self._settings else getattr(self._modifier, name)


class _Setting:
    """One driven setting of an evaluated modifier."""

    def __init__(self, ob: Any, modifier: Any, name: str, copies: list[Any]) -> None:
        """ob, modifier: evaluated; name: of the property; copies: the hook's copies of the driver's variables."""
        self.name = name
        self._curve = ob.animation_data.drivers.find(wiring.path_of(modifier, name))
        driver = self._curve.driver
        self._kind = driver.type
        self._expression: Any = None
        if self._kind == "SCRIPTED":
            self._expression = drivers.compiled(driver.expression, [each.name for each in driver.variables])
        self._addresses = [contract.region(copy, "DriverVar", "curval")[0] for copy in copies]
        self._rna = modifier.bl_rna.properties[name]

    def value(self) -> Any:
        """Returns the setting's value in this evaluation. Raises
        LeaveToBlender if its driver has none, for example because a property that it reads was removed."""
        numbers = [ctypes.c_float.from_address(address).value for address in self._addresses]
        if not all(map(math.isfinite, numbers)):
            raise LeaveToBlender(f"a variable of the driver of {self.name} is not a number")
        try:
            number = driven.mapped(self._curve, drivers.value(self._kind, self._expression, numbers))
            return self._as_property(number)
        except (ArithmeticError, ValueError) as error:
            raise LeaveToBlender(f"the driver of {self.name} has no value") from error

    def _as_property(self, number: float) -> Any:
        """Returns a number as Blender stores it in the property."""
        rna = self._rna
        if rna.type == "BOOLEAN":
            return number > 1 - 2**-23
        if rna.type == "ENUM":
            chosen = [item.identifier for item in rna.enum_items if item.value == int(number)]
            if not chosen:
                raise LeaveToBlender(f"a driver sets {self.name} to a choice that it does not have")
            return chosen[0]
        if rna.type == "INT":
            number = int(number)
        return min(max(number, rna.hard_min), rna.hard_max)


class DrivenSettings:
    """The driven settings of the modifiers that Sinew replaces on one evaluated object."""

    def __init__(self, ob: Any, plan: plans.Plan) -> None:
        """ob: evaluated, and not copied again as long as this is used."""
        hook = plan.hook_of(ob)
        copies = driven.copies_in(hook) if plan.driven else []
        self._settings: dict[str, list[_Setting]] = {}
        for name, settings in plan.driven:
            for each in settings:
                own, copies = copies[: len(each.variables)], copies[len(each.variables) :]
                self._settings.setdefault(name, []).append(_Setting(ob, ob.modifiers[name], each.name, own))

    def __contains__(self, name: str) -> bool:
        """Whether the modifier of that name has driven settings."""
        return name in self._settings

    def of(self, modifier: Any) -> Any:
        """Returns an evaluated modifier with the values that its driven settings have in this evaluation. Raises
        LeaveToBlender."""
        found = self._settings.get(modifier.name)
        return modifier if found is None else WithSettings(modifier, {each.name: each.value() for each in found})
