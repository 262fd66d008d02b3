within WheelsetRig.Sensors;
model IdealSpeedSensor "Null version: the sensor reads the truth"
  extends PartialSpeedSensor;
  extends Common.Signals.Unchanged;
end IdealSpeedSensor;
