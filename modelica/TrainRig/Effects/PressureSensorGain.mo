within TrainRig.Effects;
model PressureSensorGain "a pressure sensor of a bogie with a wrong gain"
  extends Slots.PartialBogies;
  parameter Real gain[n](each unit="1", each min=-0.5, each max=0.5) = zeros(n) "Reading beyond the pressure, relative";
equation
  for i in 1:n loop
    y[i] = u[i]/(1.0 + gain[i]);
    held[i] = heldBefore[i]*(1.0 + gain[i]);
  end for;
  rest = restBefore;
  annotation (
    __Workbench(effect(
      size="gain", matters=0.025,
      separation="the reading beside a gauge")),
    Documentation(info="<html>
<p>The cylinders have less than what is read. Weak pads on both axles of the bogie look alike, unless the
pressure that the brake asks for is known.</p>
</html>"));
end PressureSensorGain;
