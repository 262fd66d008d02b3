within WheelsetRig.Sensors;
partial model PartialForceSensor "Slot: what load cells make of a force"
  extends Common.Interfaces.Signal(u(unit="N"), y(unit="N"));
end PartialForceSensor;
