within TrainRig;
package Effects "What the train may lack; each is a class that describes itself"
  annotation (Documentation(info="<html>
<p>An effect on an axle, a bogie or a vehicle has a size for each of them, of which one is its cause.</p>
</html>"));
end Effects;
