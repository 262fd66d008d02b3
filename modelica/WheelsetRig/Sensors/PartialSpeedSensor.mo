within WheelsetRig.Sensors;
partial model PartialSpeedSensor "Slot: what a speed sensor makes of an angular velocity"
  extends Common.Interfaces.Signal(u(unit="rad/s"), y(unit="rad/s"));
end PartialSpeedSensor;
