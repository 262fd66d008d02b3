within TrainRig.Effects;
model WheelRadius "a wheel radius that differs from the data sheet"
  extends Slots.PartialAxles;
  parameter Real deviation[n](each unit="m", each min=-0.02, each max=0.02) = zeros(n) "True minus sheet";
equation
  for i in 1:n loop
    y[i] = u[i] + deviation[i];
  end for;
  annotation (
    __Workbench(effect(
      size="deviation", matters=0.0005, slots={"radius"},
      separation="the wheel, measured")),
    Documentation(info="<html>
<p>A wheel that was turned and not entered. A wrong number of poles reads alike.</p>
</html>"));
end WheelRadius;
