within CascadedTanks.Effects;
model LowerOutletHead "an outlet below the bottom of the lower tank"
  extends Slots.PartialOutlet;
  parameter Real head(unit="V", min=0.0, max=20.0) = 0.0 "Height of the bottom above the outlet";
equation
  actual = nominal + k*(Functions.root(h + head) - Functions.root(h));
  annotation (
    __Workbench(effect(
      size="head", matters=0.3,
      slots={"lowerOutlet"},
      separation="the level at which the lower outlet stops to run; the height of its pipe")),
    Documentation(info="<html>
<p><code>k*sqrt(level + head)</code> in place of <code>k*sqrt(level)</code>: a pipe below the tank, or a
sensor whose zero is above the bottom.</p>
</html>"));
end LowerOutletHead;
