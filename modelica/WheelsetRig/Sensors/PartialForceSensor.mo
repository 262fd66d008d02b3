within WheelsetRig.Sensors;
partial model PartialForceSensor "Slot: what load cells make of a force"
  input Units.Force F "True force";
  output Units.Force reading "What the sensor reads";
end PartialForceSensor;
