within TrainRig.Effects;
model AccelerometerGain "an accelerometer with a wrong gain"
  extends Common.Interfaces.Signal;
  parameter Real gain(unit="1", min=-0.9, max=1.0) = 0.0 "Reading beyond the acceleration, relative";
equation
  y = u*(1.0 + gain);
  annotation (
    __Workbench(effect(
      size="gain", matters=0.015, slots={"accelerometer"},
      separation="the reading of the sensor turned upside down")),
    Documentation(info="<html>
<p>It shows as the train brakes: the rate of the axles' speeds is another one.</p>
</html>"));
end AccelerometerGain;
