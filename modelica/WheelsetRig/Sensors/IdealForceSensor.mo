within WheelsetRig.Sensors;
model IdealForceSensor "Null version: the sensor reads the truth"
  extends PartialForceSensor;
  extends Common.Signals.Unchanged;
end IdealForceSensor;
