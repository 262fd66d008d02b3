within WheelsetRig.Sensors;
model FxGain "Load cells with a wrong gain"
  extends PartialForceSensor;
  parameter Real gain(unit="1", min=-0.1, max=0.1) = 0.0 "Relative change of the reading";
equation
  reading = F*(1.0 + gain);
  annotation (
    __Workbench(effect(
      size="gain", step=0.002, matters=0.002,
      separation="a run-up with the wheelset lifted, and dead weights on the load cells")),
    Documentation(info="<html>
<p><code>reading = F*(1 + gain)</code>; 0.1 to 1 % after calibration.</p>
</html>"));
end FxGain;
