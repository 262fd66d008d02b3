within TrainRig.Slots;
partial model PartialDrag "Slot: torque on each axle beside that of braked pads"
  parameter Integer n = 8 "Axles";
  input Real omega[n](each unit="rad/s") "Angular velocity";
  output Real tau[n](each unit="N.m") "Torque that opposes it";
end PartialDrag;
