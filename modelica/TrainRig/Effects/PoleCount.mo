within TrainRig.Effects;
model PoleCount "a speed sensor with a wrong number of poles"
  extends Slots.PartialAxles;
  parameter Real gain[n](each unit="1", each min=-0.5, each max=0.5) = zeros(n) "Relative error of the reading";
equation
  for i in 1:n loop
    y[i] = u[i]*(1.0 + gain[i]);
  end for;
  annotation (
    __Workbench(effect(
      size="gain", matters=0.001, slots={"speedSensor"}, after="WheelRadius",
      separation="the poles, counted")),
    Documentation(info="<html>
<p>The reading is off by a share, as with a wrong wheel radius; no recording of speeds tells them
apart.</p>
</html>"));
end PoleCount;
