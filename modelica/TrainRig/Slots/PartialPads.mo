within TrainRig.Slots;
partial model PartialPads "Slot: friction of the pads of each axle"
  parameter Integer n = 8 "Axles";
  input Real u[n](each unit="1") "Friction by the law of ordinary pads";
  input Real T[n](each unit="K") "Temperature of the discs";
  input Real power[n](each unit="W") "Friction power of an axle's pads";
  output Real y[n](each unit="1") "Friction that acts";
end PartialPads;
