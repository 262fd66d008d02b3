within CascadedTanks.Effects;
model LowerLaminarOutlet "an outlet of the lower tank that is partly laminar"
  extends Slots.PartialOutlet;
  parameter Real rate(unit="1/s", min=0.0, max=0.1) = 0.0 "Flow per level, beside Torricelli's";
equation
  actual = nominal + rate*h;
  annotation (
    __Workbench(effect(
      size="rate", matters=1e-3,
      slots={"lowerOutlet"},
      separation="the level of the lower tank while it empties")),
    Documentation(info="<html>
<p><code>rate*level</code> beside <code>k*sqrt(level)</code>: a long or narrow pipe (Hagen-Poiseuille).</p>
</html>"));
end LowerLaminarOutlet;
