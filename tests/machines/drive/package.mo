package Drive "A shaft that turns"
  type Speed = Real "m/s or rad/s";

  partial model PartialFriction "Slot: what resists a motion"
    input Speed v "Velocity or angular velocity";
    input Speed other "Another one";
    output Real f(unit="N.m") "Resistance";
  end PartialFriction;

  model Frictionless "Null version"
    extends PartialFriction;
  equation
    f = 0.0;
  end Frictionless;

  model Motor "What drives"
    Real w(unit="rad/s") "Speed";
  end Motor;

  model Observer "A shaft"
    Motor motor "Drive";
    replaceable Frictionless friction(v=motor.w, other=2*motor.w)
      constrainedby PartialFriction(v=motor.w, other=2*motor.w) "Bearings";
  equation
    der(motor.w) = -friction.f;
  end Observer;
end Drive;
