within PositioningStage.Effects;
model CableSpring "cables that pull in proportion to the position"
  extends Interfaces.PartialCables;
  parameter Real k(unit="N/m", min=-500.0, max=500.0) = 0.0 "Stiffness";
equation
  f = k*position;
  annotation (
    __Workbench(effect(
      size="k", matters=3.0,
      separation="the carriage at rest along its way")),
    Documentation(info="<html>
<p>Of a chain that bends, too.</p>
</html>"));
end CableSpring;
