within TrainRig.Effects;
model AccelerometerBias "an accelerometer with a zero that is off"
  extends Common.Interfaces.Signal;
  parameter Real offset(unit="m/s2", min=-1.0, max=1.0) = 0.0 "Reading beyond the acceleration";
equation
  y = u + offset;
  annotation (
    __Workbench(effect(
      size="offset", matters=0.05, slots={"accelerometer"},
      separation="the reading of the train at rest on a level track")),
    Documentation(info="<html>
<p>A sensor that is mounted with a tilt of 0.3 degrees reads 0.05 m/s2 at rest.</p>
</html>"));
end AccelerometerBias;
