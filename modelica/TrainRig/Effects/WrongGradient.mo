within TrainRig.Effects;
model WrongGradient "a track file whose gradients are off by the same everywhere"
  extends Common.Interfaces.Signal;
  parameter Real offset(unit="1", min=-0.02, max=0.02) = 0.0 "True minus file";
equation
  y = u + offset;
  annotation (
    __Workbench(effect(
      size="offset", matters=4.5e-4, slots={"gradient"},
      separation="the same way in the other direction")),
    Documentation(info="<html>
<p>Another line, or a wrong sign of small gradients.</p>
</html>"));
end WrongGradient;
