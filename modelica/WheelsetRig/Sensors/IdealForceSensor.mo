within WheelsetRig.Sensors;
model IdealForceSensor "Null version: the sensor reads the truth"
  extends PartialForceSensor;
equation
  reading = F;
end IdealForceSensor;
