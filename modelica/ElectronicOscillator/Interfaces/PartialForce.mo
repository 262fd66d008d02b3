within ElectronicOscillator.Interfaces;
partial model PartialForce "Slot: what pulls back, beside the linear spring and damper"
  input Real v(unit="V/s") "Rate of the displacement";
  input Real y(unit="V") "Displacement";
  output Real f(unit="V") "Against a positive displacement";
end PartialForce;
