within WheelsetRig.Sensors;
partial model PartialForceSensor "Slot: what load cells make of a force"
  extends Common.Interfaces.Signal(u(unit="N"), y(unit="N"));
  input Units.Force Q "Wheel load, which leans on the cells where the contact is no level";
end PartialForceSensor;
