within WheelsetRig.Sensors;
partial model PartialSpeedSensor "Slot: what a speed sensor makes of an angular velocity"
  input Units.AngularVelocity omega "True angular velocity";
  output Units.AngularVelocity reading "What the sensor reads";
end PartialSpeedSensor;
