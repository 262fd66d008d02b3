within CascadedTanks.Effects;
model UpperLeak "an upper tank that leaks past the lower one"
  extends Slots.PartialRim;
  parameter Real rate(unit="1/s", min=0.0, max=0.1) = 0.0 "Leakage per level";
equation
  leaves = rate*h;
  caught = 0.0;
  annotation (
    __Workbench(effect(
      size="rate", matters=1e-3,
      slots={"upperRim"},
      separation="the level of the upper tank over an hour, with its outlet closed")),
    Documentation(info="<html>
<p><code>leaves = rate*level</code>: laminar flow through a gap or a wall, lost to both tanks.</p>
</html>"));
end UpperLeak;
