package Kettle "Water that a body heats"
  model Observer "Heat of a body and of the water about it"
    parameter Real loss(unit="W/K") = 5.0 "Of the water to the room";
    input Real P(unit="W") "Heating";
    input Real dloss(unit="W/K") "Correction of loss";
    output Real reading(unit="K") = water + 40.0 "What the sensor says";
    Real body(unit="K", start=0.0, fixed=true, nominal=50.0) "Over the room";
    Real water(unit="K", start=10.0, fixed=true, nominal=50.0) "Over the room";
  equation
    200.0*der(body) = P - 20.0*(body - water);
    2000.0*der(water) = 20.0*(body - water) - (loss + dloss)*water;
  end Observer;
end Kettle;
