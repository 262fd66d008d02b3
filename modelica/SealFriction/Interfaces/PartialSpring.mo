within SealFriction.Interfaces;
partial model PartialSpring "Slot: what the stroke alone resists by"
  input Real s(unit="m") "Stroke";
  output Real f(unit="N") "Resisting force";
end PartialSpring;
