within WheelsetRig.Sensors;
model FxGain "Load cells with a wrong gain"
  extends PartialForceSensor;
  extends Common.Signals.Gain(gain(min=-0.1, max=0.1));
  annotation (
    __Workbench(effect(
      size="gain", matters=0.002,
      separation="a run-up with the wheelset lifted, and dead weights on the load cells")),
    Documentation(info="<html>
<p>0.1 to 1 % after calibration.</p>
</html>"));
end FxGain;
