within CascadedTanks.Effects;
model LowerTankWidens "a lower tank that is wider at the top"
  extends Slots.PartialTank;
  parameter Real widening(unit="1", min=-0.2, max=0.2) = 0.0 "Relative change of the section, over half the range";
  final parameter Real middle(unit="V") = 5.0 "Of the range";
equation
  actual = nominal/sqrt((1.0 + widening*(h - middle)/middle)^2 + 1e-3*widening^2);
  annotation (
    __Workbench(effect(
      size="widening", matters=0.05,
      separation="a rule along the tank; the rise of the level with the outlet closed")),
    Documentation(info="<html>
<p>The section is <code>1 + widening*(level - middle)/middle</code> of that in the middle. Levels at rest do not
depend on it, unlike those that a sensor with a bent characteristic reads.</p>
</html>"));
end LowerTankWidens;
