within TrainRig;
function ordinaryFriction "Friction of ordinary pads on a dry disc"
  input Real muDC(unit="1") "At vRef, 35 kN and 60 degC";
  input Real v(unit="m/s") "Speed of the train";
  input Real Fperp(unit="N") "Force of a pad pair";
  input Real T(unit="K") "Temperature of the disc";
  input Real speedLaw(unit="1") = 0.20 "Relative fall from standstill to vRef";
  input Real vRef(unit="m/s") = 22.0 "Speed at which it is muDC";
  input Real exponent(unit="1") = 0.02 "Of the fall with the force";
  input Real fade(unit="1/K") = 3e-4 "Relative fall with temperature";
  output Real mu(unit="1") "Friction";
algorithm
  mu := muDC*(1.0 + speedLaw*(1.0 - v/vRef))
    *(noEvent(max(100.0, Fperp))/35000.0)^(-exponent)*(1.0 - fade*(T - 333.15));
end ordinaryFriction;
