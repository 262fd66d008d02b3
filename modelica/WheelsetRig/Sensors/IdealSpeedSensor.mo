within WheelsetRig.Sensors;
model IdealSpeedSensor "Null version: the sensor reads the truth"
  extends PartialSpeedSensor;
equation
  reading = omega;
end IdealSpeedSensor;
