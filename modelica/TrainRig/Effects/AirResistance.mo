within TrainRig.Effects;
model AirResistance "air that resists otherwise"
  extends Common.Interfaces.Signal;
  parameter Real gain(unit="1", min=-0.9, max=2.0) = 0.0 "Relative change of its resistance";
equation
  y = u*(1.0 + gain);
  annotation (
    __Workbench(effect(
      size="gain", matters=0.2, slots={"airResistance"},
      separation="coasting in both directions")),
    Documentation(info="<html>
<p>Wind, or a window that is open.</p>
</html>"));
end AirResistance;
