within HeatedHouse;
package Tests "Claims, each a model with asserts that follow from the law"
end Tests;
